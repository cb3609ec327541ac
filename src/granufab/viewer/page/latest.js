// Work asked for faster than it is done: one at a time, and then only the last that was asked for.

export function latest(work) {
  let waiting = null;
  let busy = null;
  async function run() {
    while (waiting) {
      const [arguments_, done] = waiting;
      waiting = null;
      await work(...arguments_);
      done();
    }
    busy = null;
  }
  return (...arguments_) => {
    const before = waiting && waiting[1]; // who waited is told when the newer one is done
    const promise = new Promise((done) => { waiting = [arguments_, () => { if (before) before(); done(); }]; });
    if (!busy) busy = run();
    return promise;
  };
}
