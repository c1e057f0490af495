// Requests of the server that the page came from: not too many at once, and again after a pause when one fails.

/** Requests under way at once: as many as browsers make of one server. */
const MAX_REQUESTS = 6;
/** Milliseconds before a request is made again, the first time, the second and so on; then it is given up. */
const PAUSES = [500, 1000, 2000, 4000, 8000];
/** Answers below 500 that may be others later: too slow, too early, too many. */
const FOR_NOW = [408, 425, 429];

class Asker {
  constructor() {
    this.under = 0;
    this.paused = 0;
    this.received = 0; // bytes
    this.pauses = PAUSES;
    this.failed = new Map(); // how often, by address
  }

  /** Requests that may be made. */
  get room() {
    return MAX_REQUESTS - this.under;
  }

  get isIdle() {
    return this.under === 0 && this.paused === 0;
  }

  /** The bytes at an address. What is thrown has `isForNow` where the same request may do better later. */
  async get(address, signal) {
    this.under++;
    try {
      const answer = await fetch(address, { signal });
      if (!answer.ok) throw refusal(answer);
      const buffer = await answer.arrayBuffer();
      this.received += Number(answer.headers.get('content-length')) || buffer.byteLength;
      this.failed.delete(address);
      return buffer;
    } catch (error) {
      error.isForNow ??= true; // no answer, or one cut off
      throw error;
    } finally {
      this.under--;
    }
  }

  /** Calls `again` after a pause, a longer one each time; or tells why not, if it is of no use or was tried often enough. */
  later(address, error, again) {
    const times = (this.failed.get(address) ?? 0) + 1;
    if (!error.isForNow) return error.message;
    if (times > this.pauses.length) return `${error.message}, asked for ${times} times; reload the page to try again`;
    this.failed.set(address, times);
    this.paused++;
    setTimeout(() => { this.paused--; again(); }, this.pauses[times - 1]);
    return '';
  }
}

function refusal({ status, statusText }) {
  const isForNow = status >= 500 || FOR_NOW.includes(status);
  return Object.assign(new Error(`${status} ${statusText}`), { isForNow });
}
