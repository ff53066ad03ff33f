"use strict";
// A scene of boxes or triangles in 3-D along a path of cameras; the state is in the hash of the address.
(() => {
  const { mesh, nodes, runs, data, FATES, frames, fates, decode, boxes, bounds, ids, cameras, mul, apply, inverse, scaled, minus, plus, upright, length, REACH } = scene;
  const $ = (id) => document.getElementById(id);
  const el = (tag, text = "", props = {}) => Object.assign(document.createElement(tag), { textContent: text, ...props });
  const count = (n) => Math.round(n).toLocaleString("en");
  const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

  // ---- state, kept in the hash of the address
  const ZOOM = 1.7;
  const HOME = { yaw: -0.9, pitch: 0.6, distance: 0, target: [0, 0, 0] };
  const look = { ...HOME, frame: 0, through: false, boxes: false, nodes: false, off: new Set() };
  const SWITCHES = ["through", "boxes", "nodes"];
  const keep = () => {
    const numbers = [look.yaw, look.pitch, look.distance, ...look.target].map((x) => +x.toPrecision(5));
    const parts = [`frame=${look.frame}`, `look=${numbers.join(",")}`];
    SWITCHES.forEach((key) => look[key] && parts.push(`${key}=1`));
    if (look.off.size) parts.push(`off=${[...look.off].join(",")}`);
    history.replaceState(null, "", "#" + parts.join("&"));
  };
  const read = () => {
    SWITCHES.forEach((key) => (look[key] = false));
    look.off = new Set();
    for (const [key, text] of new URLSearchParams(location.hash.slice(1))) {
      const numbers = text.split(",").filter(Boolean).map(Number);
      if (!numbers.length || !numbers.every(Number.isFinite)) continue;
      if (key === "frame") look.frame = clamp(Math.round(numbers[0]), 0, frames.length - 1);
      if (SWITCHES.includes(key)) look[key] = numbers[0] === 1;
      if (key === "off") look.off = new Set(numbers);
      if (key === "look" && numbers.length === 6 && numbers[2] > 0) {
        [look.yaw, look.pitch, look.distance, ...look.target] = numbers;
      }
    }
  };

  // ---- drawing
  const canvas = $("stage");
  const gl = canvas.getContext("webgl2", { antialias: false, alpha: false });
  let gpu = null;
  const fault = (text) => {
    gpu = null;
    $("fault").textContent = `${text}. The counts are complete.`;
    $("fault").hidden = false;
    canvas.hidden = true;
  };

  // Colours of the style sheet, light or dark.
  let paint = null;
  const rgb = (node) => getComputedStyle(node).color.match(/[\d.]+/g).slice(0, 3).map((x) => x / 255);
  const readColours = () => {
    const probe = el("i");
    document.body.append(probe);
    const of = (name) => ((probe.className = name), rgb(probe));
    const ground = getComputedStyle(document.body).backgroundColor.match(/[\d.]+/g).slice(0, 3).map((x) => x / 255);
    const colours = FATES.map(([, name]) => of(name));
    // Culled items stay in the background.
    colours[0] = ground.map((x, k) => 0.55 * x + 0.45 * colours[0][k]);
    paint = { ground, ink: of("c6"), colours, verdicts: VERDICTS.map(([name]) => of(name)) };
    probe.remove();
    legend.forEach((row, n) => row && (row.swatch.style.background = `rgb(${paint.colours[n].map((x) => 255 * x)})`));
  };

  const axes = ({ yaw, pitch }) => {
    const n = [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
    const u = [-Math.sin(yaw), Math.cos(yaw), 0];
    const v = [n[1] * u[2] - n[2] * u[1], n[2] * u[0] - n[0] * u[2], n[0] * u[1] - n[1] * u[0]];
    return [u, v, n].map(upright);
  };
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  // The whole scene just fits the canvas.
  const fit = () => {
    const [u, v, n] = axes(HOME);
    const [x, y] = [ZOOM / Math.max(aspect(), 0.1), ZOOM];
    const reach = (corner) => Math.max(Math.abs(dot(corner, u)) * x, Math.abs(dot(corner, v)) * y) + dot(corner, n);
    const all = [0, 1, 2, 3, 4, 5, 6, 7].map((c) => bounds.map((side, k) => (c >> k & 1 ? side : -side)));
    return { ...HOME, distance: 1.05 * Math.max(...all.map(reach), 0.1) };
  };
  const aspect = () => canvas.clientWidth / canvas.clientHeight || 1;
  const view = () => {
    const { distance, target } = look;
    if (look.through) {
      const camera = cameras[look.frame];
      const scale = Math.min(1, aspect() / camera.aspect) * 0.94;
      const window = scaled((scale * camera.aspect) / aspect(), scale, 1);
      return { clip: mul(window, camera.clip), eye: camera.eye, window };
    }
    const [u, v, n] = axes(look);
    const eye = plus(target, n, distance);
    const turn = [u[0], v[0], n[0], 0, u[1], v[1], n[1], 0, u[2], v[2], n[2], 0, -dot(u, eye), -dot(v, eye), -dot(n, eye), 1];
    const [near, far] = [distance / 50, distance + length(target) + 2 * REACH];
    const lens = [ZOOM / Math.max(aspect(), 0.1), 0, 0, 0, 0, ZOOM, 0, 0, 0, 0, (near + far) / (near - far), -1, 0, 0, (2 * near * far) / (near - far), 0];
    return { clip: mul(lens, turn), eye: [...eye, 1], u, v };
  };
  const square = (p) => p.flatMap((a, n) => [...a, ...p[(n + 1) % 4]]);
  const frustum = ({ corners, from, isOpen }) => {
    const lines = [square(corners.map((c) => c[0])), corners.flatMap((c) => [...from, ...c[1]])];
    return lines.concat(isOpen ? [] : [square(corners.map((c) => c[1]))]).flat();
  };
  const outline = (b) => {
    const rim = (z) => [[b[0], b[1], z], [b[3], b[1], z], [b[3], b[4], z], [b[0], b[4], z]];
    const [low, high] = [rim(b[2]), rim(b[5])];
    return [...square(low), ...square(high), ...low.flatMap((p, k) => [...p, ...high[k]])];
  };

  // Nodes of the view by their verdict.
  const VERDICTS = [["c1", "rejected"], ["c0", "opened"], ["c2", "accepted"]];
  const visited = () => {
    const all = [[], [], [], []];
    runs(nodes.kinds[look.frame], (at, length, kind) => {
      for (let n = at; kind && n < at + length; n++) all[kind].push(n);
    });
    return all.slice(1);
  };

  let picked = -1;
  const REST = 2;
  // Steps of a path, not jumps.
  const isStep = (a, b) => length(minus(a, b)) < 0.1;
  const ROUTE = cameras.slice(1).flatMap(({ from }, n) => (isStep(cameras[n].from, from) ? [...cameras[n].from, ...from] : []));
  const AROUND = outline([...bounds.map((side) => -side), ...bounds]);
  const draw = (scale) => {
    const ratio = Math.min(devicePixelRatio * scale, 3);
    const size = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.max(1, Math.round(side * ratio)));
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width, canvas.height] = size;
    const { clip, eye, window } = view();
    const off = [...look.off].reduce((mask, fate) => mask | (1 << fate), 0);
    const small = scale === REST ? 0 : 3;
    const strokes = [];
    const stroke = (corners, matrix, alpha, width, isBehind, ink = paint.ink) => {
      strokes.push([corners, matrix, [...ink, alpha], width * ratio, isBehind]);
    };
    if (nodes && look.nodes) {
      visited().forEach((own, verdict) => {
        const edges = own.map((cell) => nodes.at.get(cell)).flatMap((n) => outline(nodes.boxes.slice(n, n + 6)));
        stroke(edges, clip, 0.25, 0.6, false, paint.verdicts[verdict]);
        stroke(edges, clip, 0.8, 0.6, true, paint.verdicts[verdict]);
      });
    }
    if (window) stroke(square([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), window, 0.8, 1);
    else {
      const edges = frustum(cameras[look.frame]);
      stroke(AROUND, clip, 0.15, 0.6, true);
      stroke(ROUTE, clip, 0.3, 0.6);
      stroke(edges, clip, 0.35, 0.6);
      stroke(edges, clip, 1, 1, true);
    }
    if (picked >= 0) stroke(outline(boxes.subarray(6 * picked, 6 * picked + 6)), clip, 1, 1);
    gpu.draw({ ...paint, size, off, clip, eye, small, strokes, up: data.up === "y" ? 1 : 2, isMesh: mesh && !look.boxes && !(isCoarse && scale !== REST) });
  };

  // ---- one picture per change; in motion with as many pixels as 30 pictures a second allow,
  // (boxes instead of triangles where that is not enough), at rest with four samples per pixel
  let [waiting, playing, isStale, isDrawn, shown, stepped, before, rest] = [false, false, true, false, -1, 0, 0, 0];
  let [scale, ceiling, intervals, isCoarse] = [1, REST, [], false];
  const adapt = (interval) => {
    if (interval < 250) intervals.push(interval);
    if (intervals.length < 12) return;
    const middle = intervals.sort((a, b) => a - b)[6];
    intervals = [];
    if (middle > 30) [isCoarse, ceiling, scale] = [isCoarse || scale <= 0.5, scale, Math.max(scale / 1.4, 0.5)];
    else if (middle < 20 && scale * 1.4 < ceiling) scale *= 1.4;
  };
  const redraw = () => {
    isStale = true;
    next();
  };
  const next = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame((now) => {
      waiting = false;
      if (isDrawn) adapt(now - before);
      before = now;
      if (playing && now - stepped > 1000 / 15) {
        stepped = now;
        look.frame = (look.frame + 1) % frames.length;
      }
      isDrawn = isStale || shown !== look.frame;
      isStale = false;
      if (shown !== look.frame) tell();
      if (gpu && isDrawn) draw(scale);
      clearTimeout(rest);
      if (playing) next();
      else rest = setTimeout(() => gpu && draw(REST), 150);
    });
  };

  // ---- legend, counters, time line
  const legend = FATES.map(([key, , words], fate) => {
    if (key === "hidden" && !data.samples) return null;
    const label = el("label");
    const box = el("input", "", { type: "checkbox" });
    box.addEventListener("change", () => toggle(fate));
    const [swatch, number] = [el("i"), el("output")];
    label.append(box, swatch, el("span", words), number);
    $("legend").append(label);
    return { box, swatch, number };
  });
  const toggle = (fate) => {
    if (!legend[fate]) return;
    if (!look.off.delete(fate)) look.off.add(fate);
    settle();
  };
  const mean = (list) => list.reduce((a, b) => a + b, 0) / list.length;
  const most = Math.max(...data.structures.map((s) => Math.max(...s.nodes_tested)), 1);
  const rows = data.structures.map((own) => {
    const row = el("tr");
    row.append(el("th", own.name, { scope: "row" }));
    const cells = [own.nodes_tested, own.items_tested].map((list) => {
      const cell = el("td", "", { className: "n" });
      row.append(cell, el("td", count(mean(list)), { className: "n" }));
      return [cell, list];
    });
    cells[0][0].classList.add("bar");
    $("counters").tBodies[0].append(row);
    return cells;
  });
  const svg = (tag, props) => {
    const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const key in props) node.setAttribute(key, props[key]);
    $("strip").append(node);
    return node;
  };
  const end = Math.max(frames.length - 1, 1);
  const largest = Math.max(...frames.map((frame) => frame.returned));
  const peak = Math.max(largest, 1);
  $("strip").setAttribute("viewBox", `0 0 ${end} 1`);
  for (const [name, of] of [["c2", (f) => f.counts[1]], ["c7", (f) => f.returned]]) {
    const points = frames.map((frame, n) => `${n},${1 - of(frame) / peak}`);
    svg("polyline", { class: name, points: points.join(" ") });
  }
  const cursor = svg("line", { y1: 0, y2: 1 });
  $("frame").max = frames.length - 1;
  $("peak").textContent = `returned per view, at most ${count(largest)}`;

  {
    const many = data.triangles ? ` (${count(data.triangles)} triangles; at most ${count(data.most_triangles)} are drawn)` : "";
    const what = mesh ? `${count(data.triangles)} triangles` : `boxes${many}`;
    const whose = nodes ? `those that ${nodes.name} visits, upper levels first` : "none in these structures";
    $("about").textContent = `Drawn: ${what}. Nodes: ${whose}.`;
  }

  // Everything that depends on the view of the path.
  const tell = () => {
    shown = look.frame;
    const frame = frames[shown];
    decode(frame);
    gpu?.update(fates);
    legend.forEach((row, fate) => row && (row.number.textContent = count(frame.counts[fate])));
    for (const cells of rows) {
      for (const [cell, list] of cells) cell.textContent = count(list[shown]);
      cells[0][0].style.setProperty("--v", cells[0][1][shown] / most);
    }
    const words = `view ${shown + 1} of ${frames.length} (camera ${frame.camera}): ${count(frame.returned)} of ${count(data.items)} items returned`;
    $("now").textContent = words;
    $("frame").value = shown;
    $("frame").setAttribute("aria-valuetext", words);
    canvas.setAttribute("aria-label", `The scene in 3-D, ${words}`);
    if (nodes) {
      const counts = visited().map((own) => own.length);
      const [drawn, all] = [counts.reduce((a, b) => a + b), data.structures.find((own) => own.name === nodes.name).nodes_tested[shown]];
      $("visited").replaceChildren(`nodes of ${nodes.name}: ${count(drawn)} of ${count(all)} drawn: `);
      VERDICTS.forEach(([name, word], n) => $("visited").append(n ? ", " : "", el("b", "\u25a1 ", { className: name }), `${count(counts[n])} ${word}`));
    }
    cursor.setAttribute("x1", shown);
    cursor.setAttribute("x2", shown);
    name();
  };
  const name = () => {
    if (picked < 0) return void ($("item").textContent = "");
    const box = [...boxes.subarray(6 * picked, 6 * picked + 6)].map((x, k) => scene.world(x, k % 3));
    const digits = clamp(5 - Math.floor(Math.log10(Math.max(...data.extent) || 1)), 0, 20);
    const [low, high] = [box.slice(0, 3), box.slice(3)].map((corner) => corner.map((x) => +x.toFixed(digits)).join(", "));
    $("item").textContent = `item ${ids[picked]}: ${FATES[fates[picked]][2]}; about (${low}) to (${high})`;
  };
  // After a change of the state by the keyboard or a button.
  const settle = () => {
    legend.forEach((row, fate) => row && (row.box.checked = !look.off.has(fate)));
    SWITCHES.forEach((key) => $(key).setAttribute("aria-pressed", look[key]));
    $("visited").hidden = !look.nodes;
    $("play").textContent = playing ? "pause" : "play";
    keep();
    redraw();
  };
  const step = (by) => {
    look.frame = clamp(look.frame + by, 0, frames.length - 1);
    settle();
  };
  const play = () => {
    playing = !playing;
    settle();
  };
  // A camera whose near plane rounds to its eye, seen from afar, has no view of its own.
  const isSound = () => Number.isFinite(cameras[look.frame].aspect);
  const through = () => {
    look.through = !look.through && isSound();
    settle();
  };
  const flip = (key, has) => () => {
    if (has) look[key] = !look[key];
    settle();
  };
  const [solid, layer] = [flip("boxes", mesh), flip("nodes", nodes)];
  [$("boxes").hidden, $("nodes").hidden] = [!mesh, !nodes];
  const home = () => {
    Object.assign(look, fit(), { through: false });
    settle();
  };
  const go = () => {
    if (!isSound()) return;
    const { from, corners } = cameras[look.frame];
    const far = corners.reduce((sum, c) => plus(sum, c[1], 1 / 4), [0, 0, 0]);
    const reach = minus(far, from);
    look.target = plus(from, reach, Math.min(0.5, 0.5 / length(reach)));
    look.distance = clamp(length(reach) * 1.2, 0.01, 1.5);
    look.through = false;
    settle();
  };

  // ---- mouse, touch and keys
  const free = () => {
    if (look.through) look.through = false;
  };
  const turn = (yaw, pitch) => {
    free();
    look.yaw = (look.yaw + yaw) % (2 * Math.PI);
    look.pitch = clamp(look.pitch + pitch, -1.57, 1.57);
  };
  const zoom = (factor) => {
    free();
    look.distance = clamp(look.distance * factor, 1e-4, 20);
  };
  const pan = (x, y) => {
    free();
    const { u, v } = view();
    const scale = (look.distance * 1.18) / canvas.clientHeight;
    look.target = plus(plus(look.target, u, -x * scale), v, y * scale);
  };
  // How far along a ray a triangle is met: NaN or infinite if it is not.
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const hit = (from, ray, corner) => {
    const [a, b, c] = [0, 3, 6].map((k) => mesh.at.subarray(3 * corner + k, 3 * corner + k + 3));
    const [u, v, w] = [minus(b, a), minus(c, a), minus(from, a)];
    const [p, q] = [cross(ray, v), cross(w, u)];
    const scale = dot(u, p);
    const [x, y] = [dot(w, p) / scale, dot(ray, q) / scale];
    return x >= 0 && y >= 0 && x + y <= 1 ? dot(v, q) / scale : NaN;
  };
  // The first item along the ray through a point of the canvas.
  const pick = (event) => {
    const area = canvas.getBoundingClientRect();
    const x = (2 * (event.clientX - area.left)) / area.width - 1;
    const y = 1 - (2 * (event.clientY - area.top)) / area.height;
    const back = inverse(view().clip);
    const [a, b] = [-1, 1].map((z) => apply(back, [x, y, z, 1])).map((p) => p.slice(0, 3).map((c) => c / p[3]));
    const ray = minus(b, a);
    let [best, first] = [-1, Infinity];
    for (let n = 0; n < data.items; n++) {
      if (look.off.has(fates[n])) continue;
      let [enter, leave] = [-Infinity, Infinity];
      for (let k = 0; k < 3; k++) {
        const [p, q] = [(boxes[6 * n + k] - a[k]) / ray[k], (boxes[6 * n + 3 + k] - a[k]) / ray[k]];
        enter = Math.max(enter, Math.min(p, q));
        leave = Math.min(leave, Math.max(p, q));
      }
      if (mesh && !look.boxes) {
        if (leave < 0 || enter > leave) continue;
        for (let t = 3 * mesh.first[n]; t < 3 * mesh.first[n + 1]; t += 3) {
          const at = hit(a, ray, t);
          if (at > 0 && at < first) [best, first] = [n, at];
        }
      } else if (enter > 0 && enter <= leave && enter < first) [best, first] = [n, enter];
    }
    return [best, plus(a, ray, first)];
  };
  const pointers = new Map();
  let moved = 0;
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, event);
    moved = 0;
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const [x, y] = [event.clientX - before.clientX, event.clientY - before.clientY];
    moved += Math.abs(x) + Math.abs(y);
    const other = [...pointers.values()].find((p) => p.pointerId !== event.pointerId);
    pointers.set(event.pointerId, event);
    if (moved < 4) return;
    const apart = (p) => Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY) || 1;
    if (other) {
      zoom(apart(before) / apart(event));
      pan(x / 2, y / 2);
    } else if (event.shiftKey || event.buttons & 6) pan(x, y);
    else turn(-x / 200, y / 200);
    redraw();
  });
  for (const kind of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(kind, (event) => {
      pointers.delete(event.pointerId);
      if (kind === "pointerup" && moved < 4 && gpu) {
        [picked] = pick(event);
        name();
      }
      settle();
    });
  }
  canvas.addEventListener("dblclick", (event) => {
    const [item, point] = pick(event);
    if (item >= 0 && !look.through) look.target = point;
    settle();
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.exp(event.deltaY * (event.deltaMode ? 0.05 : 0.0015)));
    redraw();
  }, { passive: false });
  const KEYS = {
    " ": play, c: through, b: solid, n: layer, f: go, 0: home,
    ArrowLeft: (e) => step(e.shiftKey ? -10 : -1), ArrowRight: (e) => step(e.shiftKey ? 10 : 1),
    Home: () => step(-frames.length), End: () => step(frames.length),
    a: () => turn(-0.1, 0), d: () => turn(0.1, 0), w: () => turn(0, 0.1), s: () => turn(0, -0.1),
    q: () => zoom(1.15), e: () => zoom(1 / 1.15),
  };
  Object.keys(FATES).filter((fate) => legend[fate]).forEach((fate, n) => (KEYS[n + 1] = () => toggle(Number(fate))));
  document.addEventListener("keydown", (event) => {
    const act = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    const isOwn = event.target.matches?.("button,summary,input[type=checkbox]") && event.key === " ";
    const isSlider = event.target === $("frame") && event.key.length > 1 && !event.shiftKey;
    if (!act || isOwn || isSlider || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    act(event);
    settle();
  });
  $("play").addEventListener("click", play);
  $("through").addEventListener("click", through);
  $("boxes").addEventListener("click", solid);
  $("nodes").addEventListener("click", layer);
  $("frame").addEventListener("input", () => {
    look.frame = Number($("frame").value);
    redraw();
  });
  $("frame").addEventListener("change", keep);
  addEventListener("hashchange", () => {
    read();
    settle();
  });
  matchMedia("(prefers-color-scheme:dark)").addEventListener("change", () => {
    readColours();
    redraw();
  });
  new ResizeObserver(redraw).observe(canvas);
  canvas.addEventListener("webglcontextlost", () => fault("WebGL2: the context was lost; expected a page loaded again"));

  try {
    if (gl) gpu = painter(gl, boxes, data.items, mesh);
    else fault("WebGL2: not available in this browser; expected one that has it");
  } catch (error) {
    fault(`WebGL2: ${String(error.message).split("\n")[0]}; expected shaders that compile`);
  }
  readColours();
  Object.assign(look, fit());
  read();
  settle();
})();
