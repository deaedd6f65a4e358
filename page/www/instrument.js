"use strict";

/** The instrument in WebAssembly: text in, text out, through one buffer. */
class Instrument {
  /** `text`: the module's bytes in base 64, so that the page opens from a file as well as from a server. */
  static async load(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const { instance } = await WebAssembly.instantiate(bytes, {});
    return new Instrument(instance.exports);
  }

  constructor(exports) {
    this.exports = exports;
  }

  /** Does what a person wants (`Act` in bench.rs) and gives what comes of it (`Answer`). */
  act(what) {
    const { memory, buffer, act, answer } = this.exports;
    const request = new TextEncoder().encode(JSON.stringify(what));
    const at = buffer(request.length);
    new Uint8Array(memory.buffer).set(request, at);
    const length = act();
    return JSON.parse(new TextDecoder().decode(new Uint8Array(memory.buffer, answer(), length)));
  }
}
