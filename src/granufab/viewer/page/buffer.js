// Named arrays and a header in one block of bytes, little-endian (docs/viewer.md, packing).

import { Failure } from "./failure.js";

const KINDS = {
  float32: Float32Array, float64: Float64Array, uint32: Uint32Array, int32: Int32Array,
  uint16: Uint16Array, int16: Int16Array, uint8: Uint8Array, int8: Int8Array,
};

// The header and the typed arrays of a block.
export function unpack(buffer) {
  const view = new DataView(buffer);
  const magic = String.fromCharCode(...new Uint8Array(buffer, 0, 4));
  if (magic !== "GFV1") throw new Failure("this is no frame");
  const begin = 8 + view.getUint32(4, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, begin - 8)));
  const arrays = {};
  for (const [name, item] of Object.entries(header.arrays)) {
    const count = item.shape.reduce((a, b) => a * b, 1);
    arrays[name] = new KINDS[item.type](buffer, begin + item.offset, count);
  }
  return { header, ...arrays };
}
