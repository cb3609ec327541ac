// The accessible domain for a z_min and a z_max that the user moves (docs/viewer.md, fit_data).

export function moved(domain, zMin, zMax) {
  const sides = domain.sides.map((side) => {
    const [loss, gain] = side.slopes;
    const z = side.z.map((_, k) => zMin + ((zMax - zMin) * k) / (side.z.length - 1));
    const star = (loss * zMin + gain * zMax) / (loss + gain);
    const lost = z.map((value) => side.sign * loss * (1 - zMin / value));
    const gained = z.map((value) => side.sign * gain * (zMax / value - 1));
    const a_max = z.map((_, k) => (Math.abs(lost[k]) < Math.abs(gained[k]) ? lost[k] : gained[k]));
    return { ...side, z, loss: lost, gain: gained, a_max, z_star: star, a_star: side.sign * loss * (1 - zMin / star) };
  });
  const ends = [zMin, zMax].map((z) => z / (2 * domain.dimension));
  const mohr = { ...domain.mohr, limits: ends, critical: [0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0])] };
  return { ...domain, z_min: zMin, z_max: zMax, z_star: sides[0].z_star, a_star: sides[0].a_star, sides, mohr };
}
