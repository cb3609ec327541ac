// The accessible domain (docs/viewer.md, fit_data): for limits that the user moves, and in words.

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

// The fitted domain, or the one for the limits that the view holds.
export function chosen(fitted, view) {
  if (!fitted || (!view.low && !view.high)) return fitted;
  const [low, high] = [Number(view.low || fitted.z_min), Number(view.high || fitted.z_max)];
  return low > 0 && low < high ? moved(fitted, low, high) : fitted;
}

// Largest |a'| at z on the side of the sign of a', null outside z_min … z_max.
export function largest(domain, z, a) {
  const side = domain.sides.find((one) => (one.sign < 0) === (a < 0)) || domain.sides[0];
  const [loss, gain] = side.slopes;
  if (z < domain.z_min || z > domain.z_max) return null;
  return Math.min(loss * (1 - domain.z_min / z), gain * (domain.z_max / z - 1));
}

export function where(domain, point) {
  if (!domain || !point || point.z === null || point.a === null) return "";
  const { z, a } = point;
  if (z < domain.z_min) return `outside: z lies ${(domain.z_min - z).toFixed(3)} below z_min`;
  if (z > domain.z_max) return `outside: z lies ${(z - domain.z_max).toFixed(3)} above z_max`;
  const limit = largest(domain, z, a);
  const away = limit - Math.abs(a);
  const said = `a_max(z) = ${limit.toFixed(3)}`;
  return away >= 0 ? `inside: |a'| lies ${away.toFixed(3)} below ${said}` : `outside: |a'| lies ${(-away).toFixed(3)} above ${said}`;
}
