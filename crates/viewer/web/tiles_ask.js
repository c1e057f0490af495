// Requests to the server of the page: a limited number at once, repeated after a pause if they fail.

/** Maximum number of concurrent requests: the limit of browsers for one server. */
const MAX_REQUESTS = 6;
/** Milliseconds before each repetition of a failed request; afterwards it is given up. */
const PAUSES = [500, 1000, 2000, 4000, 8000];
/** Temporary failures below 500: timeout, too early, too many requests. */
const FOR_NOW = [408, 425, 429];

class Asker {
  constructor() {
    this.under = 0;
    this.paused = 0;
    this.received = 0; // bytes
    this.pauses = PAUSES;
    this.failed = new Map(); // number of failures by address
  }

  /** Number of requests that may be made now. */
  get room() {
    return MAX_REQUESTS - this.under;
  }

  get isIdle() {
    return this.under === 0 && this.paused === 0;
  }

  /** The bytes at an address. Errors have `isForNow` if the request may succeed later. */
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
      error.isForNow ??= true; // no answer, or an incomplete one
      throw error;
    } finally {
      this.under--;
    }
  }

  /** Calls `again` after an increasing pause; or returns the reason if the failure is permanent or repeated too often. */
  later(address, error, again) {
    const times = (this.failed.get(address) ?? 0) + 1;
    if (!error.isForNow) return error.message;
    if (times > this.pauses.length) return `${error.message} after ${times} requests; reload the page to try again`;
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
