// What the page holds: the content as JSON, and arrays that are unpacked when they are asked for.
window.page = window.page || {};

(() => {
  "use strict";
  const content = JSON.parse(document.getElementById("content").textContent);
  const kept = new Map();

  function bytesOf(text) {
    if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
    const read = atob(text), bytes = new Uint8Array(read.length);
    for (let k = 0; k < read.length; k++) bytes[k] = read.charCodeAt(k);
    return bytes;
  }

  // The bytes of an array; its text is dropped once it is read.
  async function inflated(number) {
    const element = document.getElementById(`array${number}`);
    const packed = bytesOf(element.textContent);
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
    element.remove();
    return bytes;
  }

  // Levels of a series, shape (frames, points): low bytes, then high bytes, of differences between frames and between
  // points, with the sign in the lowest bit.
  function levelsOf(bytes, frames, points) {
    const size = frames * points, levels = new Uint16Array(size);
    for (let frame = 0, k = 0; frame < frames; frame++) {
      for (let point = 0, rise = 0; point < points; point++, k++) {
        const folded = bytes[k] + 256 * bytes[k + size];
        rise += (folded >> 1) ^ -(folded & 1);
        levels[k] = rise + (frame ? levels[k - points] : 0);
      }
    }
    return levels;
  }

  // Corners of triangles, from differences between first corners, and of the others from the first.
  function cornersOf(apart) {
    for (let k = 0; k < apart.length; k += 3) {
      if (k) apart[k] += apart[k - 3];
      apart[k + 1] += apart[k];
      apart[k + 2] += apart[k];
    }
    return apart;
  }

  class Series {
    constructor(entry, levels) {
      Object.assign(this, { low: entry.low, high: entry.high, step: entry.step, levels, points: entry.shape[1] });
    }

    // Numbers of one frame into an array; NaN where there is none.
    read(frame, into, every = 1, first = 0) {
      const begin = frame * this.points;
      for (let k = 0, at = first; k < this.points; k++, at += every) {
        const level = this.levels[begin + k];
        into[at] = level === 0 ? NaN : this.low + (level - 1) * this.step;
      }
      return into;
    }
  }

  async function unpack(entry) {
    const bytes = await inflated(entry.text);
    if (entry.kind === "series") return new Series(entry, levelsOf(bytes, ...entry.shape));
    if (entry.kind === "bits") return bytes;
    if (entry.kind === "triangles") return cornersOf(new Uint32Array(bytes.buffer));
    return new (entry.kind === "float32" ? Float32Array : Uint32Array)(bytes.buffer);
  }

  function array(entry) {
    if (!kept.has(entry.text)) kept.set(entry.text, unpack(entry));
    return kept.get(entry.text);
  }

  // A choice of colour as a function (frame, numbers) that fills in the numbers of that frame, and its extremes.
  async function scalar(choice) {
    const parts = await Promise.all(content.fields[choice.field].map(array));
    const chosen = choice.component === -1 ? parts : [parts[choice.component || 0]];
    const points = parts[0].points, rooms = chosen.map(() => new Float32Array(points));
    // Pieces are displaced from where they were placed, which is where they are in the first frame.
    const placed = choice.field === "displacement" && content.pieces;
    const starts = chosen.map((part) => (placed ? part.read(0, new Float32Array(points)) : null));
    if (choice.component !== -1 && !placed) {
      const [part] = chosen;
      return { fill: (frame, into) => part.read(frame, into), low: part.low, high: part.high };
    }
    const fill = (frame, into) => {
      chosen.forEach((part, c) => part.read(frame, rooms[c]));
      const value = (c, k) => rooms[c][k] - (placed ? starts[c][k] : 0);
      for (let k = 0; k < points; k++) {
        into[k] = choice.component === -1 ? Math.hypot(value(0, k), value(1, k), value(2, k)) : value(0, k);
      }
      return into;
    };
    let [low, high] = choice.component === -1 ? [0, 0] : [Infinity, -Infinity];
    const into = new Float32Array(points);
    for (let frame = 0; frame < content.frames.length; frame++) {
      const found = extremes(fill(frame, into));
      [low, high] = [Math.min(low, found[0]), Math.max(high, found[1])];
    }
    return { fill, low, high };
  }

  function extremes(numbers) {
    let low = Infinity, high = -Infinity;
    for (const number of numbers) {
      if (number < low) low = number;
      if (number > high) high = number;
    }
    return low <= high ? [low, high] : [0, 0];
  }

  // Round numbers between two, about as many as wanted.
  function ticks(low, high, wanted) {
    const span = high - low;
    if (!(span > 0)) return [low];
    const rough = span / wanted, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((s) => s * power >= rough * 0.999);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * span; k++) found.push(k * step);
    return found;
  }

  // A number in words, with no more digits than it takes.
  function said(number, digits = 4) {
    if (number === null || number === undefined || !Number.isFinite(number)) return "none";
    const text = Number(number).toPrecision(digits);
    const size = Math.abs(number);
    if (size !== 0 && (size < 1e-3 || size >= 1e5)) {
      const [mantissa, power] = Number(text).toExponential().split("e");
      return `${mantissa.replace("-", "\u2212")}\u00b710${raised(power)}`;
    }
    return String(Number(text)).replace("-", "\u2212");
  }

  function raised(power) {
    const signs = { "-": "\u207b", "+": "" };
    return [...power].map((c) => (c in signs ? signs[c] : "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"[+c])).join("");
  }

  Object.assign(window.page, { content, array, scalar, extremes, ticks, said });
})();
