// Where the data come from: the server's answers, each held while it stands (docs/viewer.md).

const HELD = 40;

export class Failure extends Error {}

async function answer(path) {
  const token = new URLSearchParams(location.search).get("token");
  const reply = await fetch(path, { headers: token ? { "X-Granufab-Token": token } : {} });
  if (!reply.ok) {
    const words = await reply.text();
    let said = words;
    try { said = JSON.parse(words).error; } catch { /* plain text */ }
    throw new Failure(said.trim());
  }
  return reply;
}

// The header and the typed arrays of a frame.
export function unpack(buffer) {
  const view = new DataView(buffer);
  const magic = String.fromCharCode(...new Uint8Array(buffer, 0, 4));
  if (magic !== "GFV1") throw new Failure("this is no frame");
  const begin = 8 + view.getUint32(4, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 8, begin - 8)));
  const kinds = { float32: Float32Array, float64: Float64Array, uint32: Uint32Array, int32: Int32Array };
  const arrays = {};
  for (const [name, item] of Object.entries(header.arrays)) {
    const count = item.shape.reduce((a, b) => a * b, 1);
    arrays[name] = new kinds[item.type](buffer, begin + item.offset, count);
  }
  return { header, ...arrays };
}

export class Source {
  held = new Map();

  runs() { return this.json("/api/runs"); }
  overview(run) { return this.json(`/api/runs/${run}`); }
  series(run) { return this.json(`/api/runs/${run}/series`); }
  fit(definition) { return this.json(`/api/fit?z_definition=${definition}`); }
  packing(run, frame, choice) {
    return this.kept(`${place(run, frame)}/packing?${query(choice)}`, async (path) => unpack(await (await answer(path)).arrayBuffer()));
  }
  state(run, frame, choice) { return this.kept(`${place(run, frame)}/state?${query(choice)}`); }
  criterion(run, frame, choice) {
    return this.kept(`${place(run, frame)}/criterion?${query({ z_definition: choice.z_definition })}`);
  }
  async json(path) { return (await answer(path)).json(); }

  // The answer to a path, asked once; a failure is not held.
  kept(path, ask = (one) => this.json(one)) {
    let found = this.held.get(path);
    if (found) this.held.delete(path);
    else {
      found = ask(path);
      found.catch(() => this.held.delete(path));
    }
    this.held.set(path, found);
    while (this.held.size > HELD) this.held.delete(this.held.keys().next().value);
    return found;
  }
  forget() { this.held.clear(); }
}

const place = (run, frame) => `/api/runs/${run}/frames/${frame}`;
const query = (choice) => new URLSearchParams(Object.entries(choice).filter(([, value]) => value)).toString();
