"use strict";
// The data of a view (#data, written by view_data.rs): boxes, sets of items, cameras, and
// the matrices to draw them with.
const scene = (() => {
  const data = JSON.parse(document.getElementById("data").textContent);

  // ---- packed numbers: five bits per digit, lowest first, 32 if more digits follow
  const VALUES = new Uint8Array(128);
  [..."ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"].forEach((c, n) => (VALUES[c.charCodeAt()] = n));
  const reader = (text) => {
    let at = 0;
    const next = () => {
      let number = 0;
      for (let scale = 1; ; scale *= 32) {
        const digit = VALUES[text.charCodeAt(at++)];
        number += (digit & 31) * scale;
        if (digit < 32) return number;
      }
    };
    const signed = () => {
      const n = next();
      return n % 2 ? -(n + 1) / 2 : n / 2;
    };
    return { next, signed, more: () => at < text.length };
  };
  // Calls `each` with the first member and the length of every run of a set.
  const runs = (text, each) => {
    const { next, more } = reader(text);
    for (let at = 0; more(); ) {
      const head = next();
      const length = head % 2 ? next() + 2 : 1;
      at += Math.floor(head / 2);
      each(at, length);
      at += length;
    }
  };

  // ---- fates of the items of a view
  const FATES = [
    ["culled", "c7", "not returned"],
    ["visible", "c2", "returned, and visible"],
    ["false_positive", "c5", "false positive: returned, not visible"],
    ["hidden", "c0", `hidden: in front at none of ${data.samples} samples`],
    ["lost", "c1", "lost: visible, not returned"],
  ];
  const frames = data.frames;
  for (const frame of frames) {
    frame.counts = FATES.map(([key], fate) => {
      let sum = 0;
      if (fate) runs(frame[key], (_, length) => (sum += length));
      return sum;
    });
    frame.counts[0] = data.items - frame.counts.reduce((a, b) => a + b, 0);
    frame.returned = frame.counts[1] + frame.counts[2] + frame.counts[3];
  }
  // Whole rows of textures.
  const padded = 1024 * Math.ceil(data.items / 1024);
  const fates = new Uint8Array(padded);
  const decode = (frame) => {
    fates.fill(0);
    FATES.slice(1).forEach(([key], n) => runs(frame[key], (at, length) => fates.fill(n + 1, at, at + length)));
  };

  // ---- boxes, in units of half the scene's diagonal about its centre
  const radius = Math.hypot(...data.extent) / 2 || 1;
  const bounds = data.extent.map((side) => side / 2 / radius);
  const centre = data.low.map((low, k) => low + data.extent[k] / 2);
  const boxes = new Float32Array(6 * padded);
  const ids = new Uint32Array(data.items);
  {
    const [id, box] = [reader(data.ids), reader(data.boxes)];
    const corner = [0, 0, 0];
    const place = (step, k) => (data.low[k] + (step / data.steps) * data.extent[k] - centre[k]) / radius;
    for (let n = 0; n < data.items; n++) {
      ids[n] = (n ? ids[n - 1] : 0) + id.signed();
      for (let k = 0; k < 3; k++) corner[k] += box.signed();
      for (let k = 0; k < 3; k++) {
        boxes[6 * n + k] = place(corner[k], k);
        boxes[6 * n + 3 + k] = place(corner[k] + box.next(), k);
      }
    }
  }

  const world = (x, k) => data.origin[k] + centre[k] + radius * x;

  // ---- matrices of 16 numbers, column by column
  const mul = (a, b) => {
    const out = [];
    for (let c = 0; c < 16; c += 4) for (let r = 0; r < 4; r++) {
      out.push(a[r] * b[c] + a[r + 4] * b[c + 1] + a[r + 8] * b[c + 2] + a[r + 12] * b[c + 3]);
    }
    return out;
  };
  const apply = (m, [x, y, z, w = 1]) => [0, 1, 2, 3].map((r) => m[r] * x + m[r + 4] * y + m[r + 8] * z + m[r + 12] * w);
  const inverse = (m) => {
    // Gauss and Jordan with pivots; rows of the matrix beside those of the unit matrix.
    const rows = [0, 1, 2, 3].map((r) => [0, 1, 2, 3, 4, 5, 6, 7].map((c) => (c < 4 ? m[4 * c + r] : +(c - 4 === r))));
    for (let c = 0; c < 4; c++) {
      const best = rows.slice(c).reduce((a, b) => (Math.abs(b[c]) > Math.abs(a[c]) ? b : a));
      rows.splice(rows.indexOf(best), 1);
      rows.splice(c, 0, best.map((x) => x / best[c]));
      rows.forEach((row, r) => r === c || (rows[r] = row.map((x, k) => x - row[c] * rows[c][k])));
    }
    return [4, 5, 6, 7].flatMap((c) => rows.map((row) => row[c]));
  };
  // A vector with z up, with the axes of the scene.
  const upright = ([x, y, z]) => (data.up === "y" ? [y, z, x] : [x, y, z]);
  const scaled = (x, y, z) => [x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1];
  const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const plus = (a, b, by = 1) => [a[0] + b[0] * by, a[1] + b[1] * by, a[2] + b[2] * by];
  const length = (a) => Math.hypot(a[0], a[1], a[2]);

  // ---- the cameras of the path
  const LOCAL = mul([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...centre, 1], scaled(radius, radius, radius));
  const REACH = 4;
  const cameras = frames.map((frame) => {
    const clip = mul(frame.clip, LOCAL);
    const back = inverse(clip);
    // The eye, or the direction towards it, in homogeneous coordinates.
    const eye = apply(back, [0, 0, -1, 0]);
    const corners = [];
    let isOpen = false;
    for (const [x, y] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
      const [a, b, c, w] = apply(back, [x, y, -1, 1]);
      const near = [a / w, b / w, c / w];
      const end = apply(back, [x, y, 1, 1]);
      const ray = plus(end, near, -end[3]);
      const size = length(ray);
      const reach = end[3] > 0 ? size / end[3] : Infinity;
      isOpen ||= reach > REACH;
      corners.push([near, plus(near, ray, Math.min(reach, REACH) / size)]);
    }
    const middle = corners.reduce((sum, [near]) => plus(sum, near, 1 / 4), [0, 0, 0]);
    const from = eye[3] > 0 ? eye.slice(0, 3).map((x) => x / eye[3]) : middle;
    const side = (a, b) => length(minus(corners[a][0], corners[b][0]));
    return { clip, eye, from, corners, isOpen, aspect: side(0, 1) / side(0, 3) };
  });

  return { data, FATES, frames, fates, decode, boxes, bounds, ids, cameras, mul, apply, inverse, scaled, minus, plus, upright, length, REACH, world };
})();
