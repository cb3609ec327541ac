// Pictures to keep: what is seen with its legend beneath, as pixels or as vectors.

import { HIGH } from "./legend.js";
import { vectors } from "./svg.js";

const TIMES = 2; // pixels of a picture per pixel of the screen

export function svgPicture(parts, { camera, look, key }) {
  const text = vectors(parts, camera, look, key, HIGH);
  return Promise.resolve(new Blob([text], { type: "image/svg+xml" }));
}

export async function pngPicture(drawer, { camera, look, key, colours }) {
  const seen = drawer.picture(camera.enlarged(TIMES), look);
  const whole = Object.assign(document.createElement("canvas"), { width: seen.width, height: seen.height + TIMES * HIGH });
  const context = whole.getContext("2d");
  context.fillStyle = colours.panel;
  context.fillRect(0, 0, whole.width, whole.height);
  context.drawImage(seen, 0, 0);
  const legend = await painted(key, camera.size[0]);
  context.drawImage(legend, 0, seen.height, TIMES * camera.size[0], TIMES * HIGH);
  return new Promise((done) => whole.toBlob(done, "image/png"));
}

// The legend as an image.
async function painted(key, wide) {
  const text = `<svg xmlns="http://www.w3.org/2000/svg" width="${TIMES * wide}" height="${TIMES * HIGH}" viewBox="0 0 ${wide} ${HIGH}" font-family="system-ui, DejaVu Sans, sans-serif">${key}</svg>`;
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`;
  await image.decode();
  return image;
}
