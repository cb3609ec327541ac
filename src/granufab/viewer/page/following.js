// Asks again and again whether the files have grown, and says once when the server is gone.

import { Failure } from "./source.js";

const PAUSE = 1500; // ms

// `changed(listed, all)` is called with the runs when one has changed, `all` where data were replaced.
export function follow(source, changed, lost) {
  let known = [];
  async function ask() {
    try {
      const listed = (await source.runs()).runs;
      const replaced = listed.some((one, k) => known[k] && one.generation !== known[k].generation);
      const grown = listed.some((one, k) => !known[k] || one.revision !== known[k].revision || one.problem !== known[k].problem);
      known = listed;
      lost("");
      if (grown || replaced) await changed(listed, replaced);
    } catch (error) {
      if (!(error instanceof Failure) && !(error instanceof TypeError)) throw error;
      lost(error instanceof Failure ? error.message : "the server does not answer; is granufab view still running?");
    }
    if (!source.saved) setTimeout(ask, PAUSE);
  }
  return ask();
}
