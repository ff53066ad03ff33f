"use strict";
// Boxes, triangles and lines by WebGL2.
const painter = (() => {
  const BOX = `precision highp float; precision highp int; precision highp usampler2D;
uniform highp sampler2D corners; uniform usampler2D fates;
uniform mat4 clip; uniform vec4 eye; uniform vec3 colours[5]; uniform int off, up;
flat out vec3 colour;
#ifdef EDGES
out vec3 at; flat out int axis;
#else
vec3 at; int axis;
#endif
// Three sides face the eye: all but one corner, 0. Corners 1, 2 and 4 belong to one side each.
void main() {
  int item = gl_VertexID >> 3, corner = gl_VertexID & 7;
  ivec2 place = ivec2(item & 1023, item >> 10);
  vec3 low = texelFetch(corners, place * ivec2(2, 1), 0).xyz;
  vec3 high = texelFetch(corners, place * ivec2(2, 1) + ivec2(1, 0), 0).xyz;
  uint fate = texelFetch(fates, place, 0).x;
  vec3 centre = (low + high) * .5;
  vec3 side = mix(vec3(-1), vec3(1), greaterThan(eye.xyz - eye.w * centre, vec3(0)));
  at = vec3(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
  axis = corner >> 1;
  float shade = axis == up ? (side[up] > 0. ? 1. : .55) : axis == 0 ? .66 : .8;
  colour = colours[fate] * shade;
  gl_Position = clip * vec4(centre + (at * 2. - 1.) * side * (high - low) * .5, 1);
  bool inside = all(greaterThan(eye.xyz, low * eye.w)) && all(lessThan(eye.xyz, high * eye.w)) && eye.w > 0.;
  if ((off >> int(fate) & 1) == 1 || inside) gl_Position = vec4(0, 0, 2, 1);
}`;
  const BOX_COLOUR = `#version 300 es
precision highp float;
flat in vec3 colour; in vec3 at; flat in int axis; out vec4 result;
void main() {
  // Edges are dark where the box has more than a few pixels.
  vec3 wide = max(fwidth(at), vec3(1e-6)), edge = min(at, 1. - at) / wide;
  if (axis == 0) edge.x = 1.; if (axis == 1) edge.y = 1.; if (axis == 2) edge.z = 1.;
  float dark = .4 * clamp(1.2 - 4. * max(wide.x, max(wide.y, wide.z)), 0., 1.);
  result = vec4(colour * (1. - dark + dark * clamp(min(edge.x, min(edge.y, edge.z)), 0., 1.)), 1);
}`;
  const MESH = `#version 300 es
precision highp float; precision highp int; precision highp usampler2D;
layout(location=0) in vec3 place; layout(location=1) in uint own;
uniform usampler2D fates; uniform mat4 clip; uniform vec3 colours[5]; uniform int off;
flat out vec3 colour;
void main() {
  int item = int(own >> 8);
  uint fate = texelFetch(fates, ivec2(item & 1023, item >> 10), 0).x;
  colour = colours[fate] * float(own & 255u) / 255.;
  gl_Position = (off >> int(fate) & 1) == 1 ? vec4(0, 0, 2, 1) : clip * vec4(place, 1);
}`;
  // Triangles and boxes of a few pixels have one colour.
  const PLAIN_COLOUR = `#version 300 es
precision highp float;
flat in vec3 colour; out vec4 result;
void main() { result = vec4(colour, 1); }`;
  const LINE = `#version 300 es
layout(location=0) in vec3 low; layout(location=1) in vec3 high;
uniform mat4 clip; uniform vec2 size; uniform float width;
void main() {
  vec4 a = clip * vec4(low, 1), b = clip * vec4(high, 1), c = a;
  // Distances to the near plane.
  float p0 = a.z + a.w, p1 = b.z + b.w;
  if (p0 < 0. && p1 < 0.) { gl_Position = vec4(0, 0, 2, 1); return; }
  if (p0 < 0.) a = mix(a, b, p0 / (p0 - p1));
  if (p1 < 0.) b = mix(b, c, p1 / (p1 - p0));
  vec2 along = (b.xy / b.w - a.xy / a.w) * size;
  along = dot(along, along) > 0. ? normalize(along) : vec2(1, 0);
  int corner = int[6](0, 1, 2, 2, 1, 3)[gl_VertexID % 6];
  vec4 p = (corner & 1) == 0 ? a : b;
  float way = (corner & 2) == 0 ? 1. : -1.;
  p.xy += vec2(-along.y, along.x) * way * width / size * p.w;
  gl_Position = p;
}`;
  const LINE_COLOUR = `#version 300 es
precision highp float;
uniform vec4 colour; out vec4 result;
void main() { result = colour; }`;

  const program = (gl, vertex, fragment) => {
    const made = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
    const names = ["corners", "fates", "clip", "eye", "colours", "off", "up", "size", "width", "colour"];
    return { made, at: Object.fromEntries(names.map((name) => [name, gl.getUniformLocation(made, name)])) };
  };
  // A texture with rows of 1,024 items; returns the function that fills it.
  const texture = (gl, unit, width, internal, format, type) => {
    const made = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, made);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.NEAREST);
    return (numbers, rows) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, rows, 0, format, type, numbers);
    };
  };
  // The last corner of a triangle decides its colour: three sides, or four corners of the
  // outline for boxes of a few pixels.
  const SIDES = [3, 7, 1, 7, 5, 1, 3, 7, 2, 7, 6, 2, 5, 7, 4, 7, 6, 4];
  const QUAD = [1, 2, 5, 2, 6, 5];

  // Chunks of the boxes, larger boxes first: the quarters by size, each along the curve. A chunk
  // has its boxes in `order`, its own box and its longest edge.
  const CHUNKS = 256, QUARTERS = 4;
  const chunked = (boxes, count) => {
    const edges = Float32Array.from({ length: count }, (_, n) => Math.max(...[0, 1, 2].map((k) => boxes[6 * n + 3 + k] - boxes[6 * n + k])));
    const order = Uint32Array.from(edges.keys()).sort((a, b) => edges[b] - edges[a]);
    const quarter = Math.ceil(count / QUARTERS), most = Math.ceil(count / CHUNKS);
    for (let n = 0; n < count; n += quarter) order.subarray(n, n + quarter).sort();
    const chunks = [];
    for (let from = 0; from < count; from += most) {
      const own = order.subarray(from, from + most);
      const side = (k, best) => own.reduce((found, n) => best(found, boxes[6 * n + k]), boxes[6 * own[0] + k]);
      const [low, high] = [[0, 1, 2].map((k) => side(k, Math.min)), [3, 4, 5].map((k) => side(k, Math.max))];
      const [centre, half] = [1, -1].map((sign) => high.map((x, k) => (x + sign * low[k]) / 2));
      chunks.push({ from, to: from + own.length, centre, half, edge: own.reduce((most, n) => Math.max(most, edges[n]), 0) });
    }
    return { order, chunks };
  };
  // Runs of boxes in sight, [from, to, is small], where the longest edge of small ones has at
  // most `pixels` of `height`.
  const inSight = (chunks, clip, height, pixels) => {
    const runs = [];
    const grows = (Math.hypot(clip[1], clip[5], clip[9]) * height) / 2;
    const row = (k) => [0, 1, 2, 3].map((c) => clip[4 * c + k]);
    const w = row(3);
    const outward = [0, 1, 2].flatMap((k) => [1, -1].map((sign) => row(k).map((x, c) => sign * x - w[c])));
    // Least value of a plane in a box.
    const least = (p, c, h) => p[3] + p[0] * c[0] + p[1] * c[1] + p[2] * c[2] - Math.abs(p[0]) * h[0] - Math.abs(p[1]) * h[1] - Math.abs(p[2]) * h[2];
    for (const { from, to, centre, half, edge } of chunks) {
      if (outward.some((plane) => least(plane, centre, half) > 0)) continue;
      const isSmall = edge * grows < pixels * least(w, centre, half);
      const last = runs.at(-1);
      if (last && last[1] === from && last[2] === isSmall) last[1] = to;
      else runs.push([from, to, isSmall]);
    }
    return runs;
  };

  // Draws `count` boxes of two corners each, or their triangles. Throws if a shader does not compile. No
  // instances: software renderers draw each by itself.
  return (gl, boxes, count, mesh) => {
    const head = "#version 300 es\n";
    const box = program(gl, `${head}#define EDGES\n${BOX}`, BOX_COLOUR);
    const [plain, line] = [program(gl, head + BOX, PLAIN_COLOUR), program(gl, LINE, LINE_COLOUR)];
    const rows = Math.ceil(count / 1024);
    texture(gl, 0, 2048, gl.RGB32F, gl.RGB, gl.FLOAT)(boxes, rows);
    const states = texture(gl, 1, 1024, gl.R8UI, gl.RED_INTEGER, gl.UNSIGNED_BYTE);
    const [items, lines] = [gl.createVertexArray(), gl.createVertexArray()];
    gl.bindVertexArray(items);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    const { order, chunks } = chunked(boxes, count);
    const corners = new Uint32Array(24 * count);
    for (const [from, shape] of [[0, SIDES], [18 * count, QUAD]]) {
      order.forEach((item, n) => shape.forEach((corner, k) => (corners[from + shape.length * n + k] = 8 * item + corner)));
    }
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    const [faces, shapes] = [program(gl, MESH, PLAIN_COLOUR), gl.createVertexArray()];
    if (mesh) {
      gl.bindVertexArray(shapes);
      [mesh.at, mesh.own].forEach((numbers, n) => {
        gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
        gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.STATIC_DRAW);
        gl.enableVertexAttribArray(n);
        n ? gl.vertexAttribIPointer(n, 1, gl.UNSIGNED_INT, 0, 0) : gl.vertexAttribPointer(n, 3, gl.FLOAT, false, 0, 0);
      });
    }
    // The last buffer that is bound: lines change it in every picture.
    gl.bindVertexArray(lines);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    for (const n of [0, 1]) {
      gl.enableVertexAttribArray(n);
      gl.vertexAttribPointer(n, 3, gl.FLOAT, false, 24, 12 * n);
    }
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);

    const update = (fates) => states(fates, rows);
    // Boxes of at most `small` pixels are drawn with fewer triangles.
    // `strokes`: [corners, matrix, colour with alpha, half the width in pixels, behind boxes?]
    const draw = ({ size, ground, colours, off, clip, eye, small, strokes, up, isMesh }) => {
      gl.viewport(0, 0, ...size);
      gl.clearColor(...ground, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      gl.disable(gl.BLEND);
      if (isMesh) {
        gl.useProgram(faces.made);
        gl.bindVertexArray(shapes);
        gl.uniformMatrix4fv(faces.at.clip, false, clip);
        gl.uniform3fv(faces.at.colours, colours.flat());
        gl.uniform1i(faces.at.off, off);
        gl.uniform1i(faces.at.fates, 1);
        gl.drawArrays(gl.TRIANGLES, 0, mesh.own.length);
      }
      gl.bindVertexArray(items);
      const runs = isMesh ? [] : inSight(chunks, clip, size[1], small);
      // Corners of a box, where their indices begin.
      for (const [{ made, at }, areSmall, each, first] of [[box, false, 18, 0], [plain, true, 6, 18 * count]]) {
        gl.useProgram(made);
        gl.uniformMatrix4fv(at.clip, false, clip);
        gl.uniform4fv(at.eye, eye);
        gl.uniform3fv(at.colours, colours.flat());
        gl.uniform1i(at.off, off);
        gl.uniform1i(at.up, up);
        gl.uniform1i(at.fates, 1);
        for (const [from, to, isSmall] of runs) {
          if (isSmall === areSmall) gl.drawElements(gl.TRIANGLES, each * (to - from), gl.UNSIGNED_INT, 4 * (first + each * from));
        }
      }
      gl.useProgram(line.made);
      gl.uniform2fv(line.at.size, size);
      gl.enable(gl.BLEND);
      gl.bindVertexArray(lines);
      for (const [corners, matrix, colour, width, isBehind] of strokes) {
        (isBehind ? gl.enable : gl.disable).call(gl, gl.DEPTH_TEST);
        const ends = new Float32Array(6 * corners.length);
        for (let n = 0; n < ends.length; n++) ends[n] = corners[6 * Math.floor(n / 36) + (n % 6)];
        gl.bufferData(gl.ARRAY_BUFFER, ends, gl.STREAM_DRAW);
        gl.uniformMatrix4fv(line.at.clip, false, matrix);
        gl.uniform1f(line.at.width, width);
        gl.uniform4fv(line.at.colour, colour);
        gl.drawArrays(gl.TRIANGLES, 0, corners.length);
      }
    };
    return { update, draw };
  };
})();
