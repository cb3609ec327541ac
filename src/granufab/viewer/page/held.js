// Answers that were asked for once, the latest of them kept.

export class Held {
  found = new Map();

  constructor(most) { this.most = most; }

  // The answer to a key, asked once; a failure is not kept.
  get(key, ask) {
    let one = this.found.get(key);
    if (one) this.found.delete(key);
    else {
      one = ask();
      one.catch(() => this.found.delete(key));
    }
    this.found.set(key, one);
    while (this.found.size > this.most) this.found.delete(this.found.keys().next().value);
    return one;
  }

  clear() { this.found.clear(); }
}
