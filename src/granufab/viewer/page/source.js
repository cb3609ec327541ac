// Where the data come from: the server's answers, each held while it stands (docs/viewer.md).

import { unpack } from "./buffer.js";
import { Failure } from "./failure.js";
import { Held } from "./held.js";
import { SavedSource, isSaved } from "./saved_source.js";

export { Failure };

const HELD = 40;

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

export class Source {
  held = new Held(HELD);
  saved = null; // words on a saved file: what it holds, what was thinned
  choices = null; // in a saved file: for each kind of criterion the definitions of z

  runs() { return this.json("/api/runs"); }
  overview(run) { return this.json(`/api/runs/${run}`); }
  series(run) { return this.json(`/api/runs/${run}/series`); }
  fit(definition) { return this.json(`/api/fit?z_definition=${definition}`); }
  packing(run, frame, choice) {
    return this.kept(`${place(run, frame)}/packing?${query(choice)}`, async (path) => unpack(await (await answer(path)).arrayBuffer()));
  }
  state(run, frame, choice) { return this.kept(`${place(run, frame)}/state?${query(choice)}`); }
  interval(run, frame, choice) {
    return this.kept(`${place(run, frame)}/interval?${query({ criterion: choice.criterion })}`);
  }
  criterion(run, frame, choice) {
    return this.kept(`${place(run, frame)}/criterion?${query({ z_definition: choice.z_definition })}`);
  }
  async json(path) { return (await answer(path)).json(); }
  kept(path, ask = (one) => this.json(one)) { return this.held.get(path, () => ask(path)); }
  forget() { this.held.clear(); }
}

// The data inside this page where it was saved with them, else the server that sent it.
export const openSource = () => (isSaved() ? new SavedSource() : new Source());

const place = (run, frame) => `/api/runs/${run}/frames/${frame}`;
const query = (choice) => new URLSearchParams(Object.entries(choice).filter(([, value]) => value)).toString();
