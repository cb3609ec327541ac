// The data of a page that was saved with them inside: blocks in base64, unpacked when shown.

import { unpack } from "./buffer.js";
import { Failure } from "./failure.js";
import { Held } from "./held.js";
import { frameOf } from "./saved_frame.js";

const CONTENTS = "saved-contents";
const HELD = 24;

export const isSaved = () => document.getElementById(CONTENTS) !== null;

// The bytes of a block of the page.
async function bytes(id) {
  const place = document.getElementById(id);
  if (!place) throw new Failure(`this file lacks its part ${id}: it was cut short or changed`);
  const text = atob(place.textContent.trim());
  const packed = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) packed[k] = text.charCodeAt(k);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  try {
    return await new Response(stream).arrayBuffer();
  } catch {
    throw new Failure(`the part ${id} of this file is damaged`);
  }
}

const json = async (id) => JSON.parse(new TextDecoder().decode(await bytes(id)));

export class SavedSource {
  held = new Held(HELD);
  saved = null;
  choices = null;

  // What the file holds; `saved` and `choices` are known once runs() has been answered.
  async contents() {
    const found = await (this.reading ??= json(CONTENTS));
    this.saved = found.saved;
    this.choices = found.choices;
    return found;
  }
  async runs() { return { runs: (await this.contents()).runs.map((one) => one.listed) }; }
  async overview(run) { return (await this.of(run)).overview; }
  async series(run) { return (await this.of(run)).series; }
  async fit(definition) {
    const { fits } = await this.contents();
    return fits[definition] ?? { missing: `this file holds no fit of ${definition}`, fit: null, domain: null };
  }
  packing(run, frame, choice) {
    return this.held.get(`packing ${run} ${frame} ${choice.criterion} ${choice.z_definition}`, async () => {
      const block = await this.block(run, frame);
      const place = placeOf(block.header.criteria, choice);
      const grains = await this.unpacked(`grains-${run}-${block.header.grains}`);
      const changes = place ? null : await this.unpacked(`changes-${run}-${frame}`);
      const data = frameOf(block, grains, changes, place, definitionOf(block.header.criteria[place], choice));
      Object.assign(data.header, { run, frame });
      return data;
    });
  }
  async state(run, frame, choice) {
    const [{ header }, found] = await Promise.all([this.block(run, frame), this.states(run, frame)]);
    const place = placeOf(header.criteria, choice);
    const state = found.states[`${place} ${definitionOf(header.criteria[place], choice)}`];
    return { units: found.units, ...state };
  }
  async interval(run, frame, choice) {
    const { header } = await this.block(run, frame);
    if (placeOf(header.criteria, choice)) return { missing: "a saved file holds changes under the run's own criterion only" };
    return (await this.unpacked(`changes-${run}-${frame}`)).header.interval;
  }
  async criterion(run, frame) { return (await this.states(run, frame)).criterion; }
  forget() { this.held.clear(); }

  async of(run) { return (await this.contents()).runs[run]; }
  block(run, frame) { return this.unpacked(`frame-${run}-${frame}`); }
  states(run, frame) { return this.held.get(`states-${run}-${frame}`, () => json(`states-${run}-${frame}`)); }
  unpacked(id) { return this.held.get(id, async () => unpack(await bytes(id))); }
}

// Where a criterion stands in the list of those that a frame holds; 0 is the run's own.
function placeOf(criteria, choice) {
  const text = choice.criterion || "";
  const [kind, number] = text.split(":");
  const same = (one) => one.criterion === text || (one.kind === kind && number !== undefined && one.threshold === Number(number));
  const place = text ? criteria.findIndex(same) : 0;
  if (place < 0) throw new Failure(`this file does not hold the criterion ${text}; move the slider, or run granufab view on the data`);
  return place;
}

function definitionOf(rule, choice) {
  const definition = choice.z_definition || rule.definitions[0];
  if (!rule.definitions.includes(definition)) throw new Failure(`this file holds ${definition} under the run's own criterion only`);
  return definition;
}
