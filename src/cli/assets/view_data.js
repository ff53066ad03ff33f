"use strict";
// The data of a view (#data, written by view.rs): boxes, triangles, sets of items, cameras, and
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
  // Calls `each` with the first member, the length and the kind of every run.
  const runs = (text, each) => {
    const { next, more } = reader(text);
    for (let at = 0; more(); ) {
      const head = next();
      const length = Math.floor(head / 5) + 1;
      each(at, length, head % 5);
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
  data.structures = data.structures.map(([name, tests]) => {
    const [nodes_tested, items_tested] = [0, 1].map((kind) => tests.map((tested) => tested[kind]));
    return { name, nodes_tested, items_tested };
  });
  for (const frame of frames) {
    frame.counts = FATES.map(() => 0);
    runs(frame.fates, (_, length, fate) => (frame.counts[fate] += length));
    frame.returned = frame.counts[1] + frame.counts[2] + frame.counts[3];
  }
  // Whole rows of textures.
  const padded = 1024 * Math.ceil(data.items / 1024);
  const fates = new Uint8Array(padded);
  const decode = (frame) => runs(frame.fates, (at, length, fate) => fates.fill(fate, at, at + length));

  // A vector with z up, with the axes of the scene.
  const upright = ([x, y, z]) => (data.up === "y" ? [y, z, x] : [x, y, z]);
  const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const plus = (a, b, by = 1) => [a[0] + b[0] * by, a[1] + b[1] * by, a[2] + b[2] * by];
  const length = (a) => Math.hypot(a[0], a[1], a[2]);

  // ---- boxes, in units of half the scene's diagonal about its centre
  const radius = Math.hypot(...data.extent) / 2 || 1;
  const bounds = data.extent.map((side) => side / 2 / radius);
  const centre = data.low.map((low, k) => low + data.extent[k] / 2);
  const place = (step, k) => (data.low[k] + (step / data.steps) * data.extent[k] - centre[k]) / radius;
  const unpacked = (text, all) => {
    const [box, corner] = [reader(text), [0, 0, 0]];
    for (let n = 0; box.more(); n += 6) {
      for (let k = 0; k < 3; k++) corner[k] += box.signed();
      for (let k = 0; k < 3; k++) {
        all[n + k] = place(corner[k], k);
        all[n + 3 + k] = place(corner[k] + box.next(), k);
      }
    }
    return all;
  };
  const boxes = unpacked(data.boxes, new Float32Array(6 * padded));
  const ids = new Uint32Array(data.items);
  {
    const id = reader(data.ids);
    for (let n = 0; n < data.items; n++) ids[n] = id.next();
  }
  // Nodes of a structure that the queries visited: where the boxes are of those that are drawn.
  const nodes = data.nodes && (() => {
    const [name, { boxes, kinds }] = data.nodes;
    const drawn = new Set();
    kinds.forEach((text) => runs(text, (at, length, kind) => {
      for (let n = at; kind && n < at + length; n++) drawn.add(n);
    }));
    const at = new Map([...drawn].sort((a, b) => a - b).map((cell, n) => [cell, 6 * n]));
    return { name, kinds, at, boxes: unpacked(boxes, []) };
  })();

  // ---- triangles: the first of each item, and a place, an item and a shade for each corner
  const mesh = data.mesh && (() => {
    const [counts, corners, points] = data.mesh.map(reader);
    const first = new Uint32Array(data.items + 1);
    for (let n = 0; n < data.items; n++) first[n + 1] = first[n] + counts.next();
    const count = 3 * first[data.items];
    const [at, own, known, step] = [new Float32Array(3 * count), new Uint32Array(count), [], [0, 0, 0]];
    const light = upright([0.35, 0.5, 0.79]);
    for (let item = 0, n = 0; n < count; n++) {
      const back = corners.next();
      if (!back) known.push(...step.map((x, k) => place((step[k] = x + points.signed()), k)));
      for (let k = 0; k < 3; k++) at[3 * n + k] = known[known.length + k - 3 * (back || 1)];
      if (n % 3 < 2) continue;
      while (n >= 3 * first[item + 1]) item++;
      const [a, b, c] = [2, 1, 0].map((k) => at.subarray(3 * (n - k), 3 * (n - k) + 3));
      const [u, v] = [minus(b, a), minus(c, a)];
      const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
      const lit = (normal[0] * light[0] + normal[1] * light[1] + normal[2] * light[2]) / (length(normal) || 1);
      own.fill(256 * item + Math.round(255 * (0.7 + 0.3 * lit)), n - 2, n + 1);
    }
    return { first, at, own };
  })();

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
  const scaled = (x, y, z) => [x, 0, 0, 0, 0, y, 0, 0, 0, 0, z, 0, 0, 0, 0, 1];

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

  return { mesh, nodes, runs, data, FATES, frames, fates, decode, boxes, bounds, ids, cameras, mul, apply, inverse, scaled, minus, plus, upright, length, REACH, world };
})();
