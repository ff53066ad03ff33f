"use strict";
// Boxes and lines by WebGL2.
const painter = (() => {
  const BOX = `#version 300 es
precision highp float; precision highp int; precision highp usampler2D;
uniform highp sampler2D corners; uniform usampler2D fates;
uniform mat4 clip; uniform vec4 eye; uniform vec3 colours[5]; uniform int off, up;
flat out vec3 colour; out vec3 at; flat out int axis;
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
  // The last corner of a triangle decides its colour: three sides, or two triangles within
  // the outline for boxes of a few pixels.
  const SIDES = [3, 7, 1, 7, 5, 1, 3, 7, 2, 7, 6, 2, 5, 7, 4, 7, 6, 4];
  const STAR = [3, 6, 5, 1, 2, 4];

  // Draws `count` boxes of two corners each. Throws if a shader does not compile. No
  // instances: software renderers draw each by itself.
  return (gl, boxes, count) => {
    const [box, line] = [program(gl, BOX, BOX_COLOUR), program(gl, LINE, LINE_COLOUR)];
    const rows = Math.ceil(count / 1024);
    texture(gl, 0, 2048, gl.RGB32F, gl.RGB, gl.FLOAT)(boxes, rows);
    const states = texture(gl, 1, 1024, gl.R8UI, gl.RED_INTEGER, gl.UNSIGNED_BYTE);
    const [items, lines] = [gl.createVertexArray(), gl.createVertexArray()];
    gl.bindVertexArray(items);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    // The largest boxes come first.
    const edges = Float32Array.from({ length: count }, (_, n) => -Math.max(...[0, 1, 2].map((k) => boxes[6 * n + 3 + k] - boxes[6 * n + k])));
    const order = Uint32Array.from(edges.keys()).sort((a, b) => edges[a] - edges[b]);
    edges.sort();
    const corners = new Uint32Array(24 * count);
    for (const [from, shape] of [[0, SIDES], [18 * count, STAR]]) {
      order.forEach((item, n) => shape.forEach((corner, k) => (corners[from + shape.length * n + k] = 8 * item + corner)));
    }
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    gl.bindVertexArray(lines);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    for (const n of [0, 1]) {
      gl.enableVertexAttribArray(n);
      gl.vertexAttribPointer(n, 3, gl.FLOAT, false, 24, 12 * n);
    }
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);

    const update = (fates) => states(fates, rows);
    // Boxes below `small` are drawn with fewer triangles.
    // `strokes`: [corners, matrix, colour with alpha, half the width in pixels, behind boxes?]
    const draw = ({ size, ground, colours, off, clip, eye, small, strokes, up }) => {
      gl.viewport(0, 0, ...size);
      gl.clearColor(...ground, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      gl.disable(gl.BLEND);
      gl.useProgram(box.made);
      gl.uniformMatrix4fv(box.at.clip, false, clip);
      gl.uniform4fv(box.at.eye, eye);
      gl.uniform3fv(box.at.colours, colours.flat());
      gl.uniform1i(box.at.off, off);
      gl.uniform1i(box.at.up, up);
      gl.uniform1i(box.at.fates, 1);
      gl.bindVertexArray(items);
      const large = small > 0 ? edges.findIndex((edge) => -edge < small) : -1;
      const full = large < 0 ? count : large;
      gl.drawElements(gl.TRIANGLES, 18 * full, gl.UNSIGNED_INT, 0);
      gl.drawElements(gl.TRIANGLES, 6 * (count - full), gl.UNSIGNED_INT, 4 * (18 * count + 6 * full));
      gl.useProgram(line.made);
      gl.uniform2fv(line.at.size, size);
      gl.enable(gl.BLEND);
      gl.bindVertexArray(lines);
      for (const [corners, matrix, colour, width, isBehind] of strokes) {
        (isBehind ? gl.enable : gl.disable).call(gl, gl.DEPTH_TEST);
        const ends = Float32Array.from({ length: 6 * corners.length }, (_, n) => corners[6 * Math.floor(n / 36) + (n % 6)]);
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
