/* A flight's data: base64 of gzip of a header (JSON) and arrays whose bytes lie plane by plane. */
(() => {
  "use strict";
  const viewer = (fusetune.viewer = fusetune.viewer || {});
  const WIDTHS = { f4: 4, u4: 4, dt: 4, u1: 1 };
  const TICK_S = 1e-4;
  const VERSION = 1;

  function bytesOf(base64) {
    const text = atob(base64.trim());
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i += 1) bytes[i] = text.charCodeAt(i);
    return bytes;
  }

  function unzipped(bytes) {
    if (typeof DecompressionStream === "undefined") {
      throw new Error("This browser cannot unpack the data (DecompressionStream); one of 2023 or newer can.");
    }
    return new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  }

  function headerOf(bytes) {
    const length = new DataView(bytes.buffer, bytes.byteOffset).getUint32(0, true);
    if (bytes.length < 4 + length) return null;
    const header = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));
    if (header.version !== VERSION)
      throw new Error(`The data are of version ${header.version}; this page reads ${VERSION}.`);
    return { header, start: 4 + length };
  }

  /* Header and arrays; an array is put together when it is first asked for. */
  async function decode(base64) {
    const bytes = new Uint8Array(await new Response(unzipped(bytesOf(base64))).arrayBuffer());
    const { header, start } = headerOf(bytes);
    const kept = new Map();
    function array(index) {
      if (!kept.has(index)) kept.set(index, unpacked(bytes, start, header.arrays[index]));
      return kept.get(index);
    }
    return { header, array };
  }

  /* The header alone, of the first pieces that come out of the stream. */
  async function decodeHeader(base64) {
    const reader = unzipped(bytesOf(base64)).getReader();
    let bytes = new Uint8Array(0);
    for (;;) {
      const { done, value } = await reader.read();
      if (done) throw new Error("The data end before their header does.");
      const longer = new Uint8Array(bytes.length + value.length);
      longer.set(bytes);
      longer.set(value, bytes.length);
      bytes = longer;
      const found = bytes.length >= 4 ? headerOf(bytes) : null;
      if (!found) continue;
      await reader.cancel();
      return found.header;
    }
  }

  function unpacked(bytes, start, { offset, count, type }) {
    const width = WIDTHS[type];
    const from = start + offset;
    if (width === 1) return bytes.slice(from, from + count);
    const whole = new Uint8Array(count * width);
    for (let plane = 0; plane < width; plane += 1) {
      const at = from + plane * count;
      for (let i = 0; i < count; i += 1) whole[i * width + plane] = bytes[at + i];
    }
    if (type === "f4") return new Float32Array(whole.buffer);
    const numbers = new Uint32Array(whole.buffer);
    return type === "dt" ? summed(numbers) : numbers;
  }

  function summed(steps) {
    const times = new Float64Array(steps.length);
    let ticks = 0;
    for (let i = 0; i < steps.length; i += 1) {
      ticks += steps[i];
      times[i] = ticks * TICK_S;
    }
    return times;
  }

  Object.assign(viewer, { decode, decodeHeader });
})();
