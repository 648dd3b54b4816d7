// A map to turn with the mouse or a finger, in WebGL 2: outer faces of its cells, lit and coloured by height, and lines.
// What it cannot draw (no WebGL, an old browser, paper) the picture in its place shows.
"use strict";
for (const figure of document.querySelectorAll("figure.view3d")) start(figure).catch((error) => console.warn(error));

async function start(figure) {
  const scene = JSON.parse(figure.querySelector("script").textContent);
  const canvas = figure.querySelector("canvas");
  const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
  if (!gl || typeof DecompressionStream === "undefined") return;
  const faces = new Uint16Array(await unpacked(scene.faces)), lines = new Float32Array(await unpacked(scene.lines));
  const programs = { faces: program(gl, FACES, LIT), lines: program(gl, LINES, PLAIN) };
  const bound = { faces: facesArray(gl, faces), lines: linesArray(gl, lines) };
  let eye = null, waiting = false;
  const draw = () => { if (!waiting) { waiting = true; requestAnimationFrame(paint); } };

  function paint() {
    waiting = false;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((n) => Math.round(n * devicePixelRatio));
    if (!width || !height) return;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    eye ??= whole(scene, width / height);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    const matrix = view(eye, width / height);
    const set = (p, name) => gl.getUniformLocation(p, name);
    let p = programs.faces;
    gl.useProgram(p);
    gl.uniformMatrix4fv(set(p, "matrix"), false, matrix);
    gl.uniform3fv(set(p, "origin"), scene.origin);
    gl.uniform3fv(set(p, "eye"), axes(eye)[2].map((x, i) => eye.at[i] + x * eye.far));
    gl.uniform1f(set(p, "cell"), scene.cell_m);
    gl.uniform2fv(set(p, "heights"), scene.heights_m);
    gl.uniform3fv(set(p, "palette"), scene.palette.flat());
    gl.bindVertexArray(bound.faces);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, faces.length / 4);
    p = programs.lines;
    gl.useProgram(p);
    gl.uniformMatrix4fv(set(p, "matrix"), false, matrix);
    gl.uniform2f(set(p, "size"), width / devicePixelRatio, height / devicePixelRatio);
    gl.uniform4fv(set(p, "colours"), scene.colours.flat());
    gl.uniform1fv(set(p, "widths"), scene.widths);
    gl.bindVertexArray(bound.lines);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, lines.length / 7);
  }

  move(canvas, () => eye, draw);
  figure.querySelector("button").onclick = () => { eye = null; draw(); };
  new ResizeObserver(draw).observe(canvas);
  figure.classList.add("live");
}

async function unpacked(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}

// Drag turns; with the right button, shift or two fingers it shifts; wheel, pinch, + and - come nearer.
function move(canvas, eyeNow, draw) {
  const held = new Map();
  const turn = (dx, dy) => {
    const eye = eyeNow();
    eye.yaw -= dx * 0.007;
    eye.pitch = Math.min(1.57, Math.max(-1.57, eye.pitch + dy * 0.007));
    draw();
  };
  const shift = (dx, dy) => {
    const eye = eyeNow(), [right, up] = axes(eye), step = (eye.far * 0.9) / canvas.clientHeight;
    eye.at = eye.at.map((x, i) => x + step * (up[i] * dy - right[i] * dx));
    draw();
  };
  const nearer = (factor) => { const eye = eyeNow(); eye.far = Math.min(5000, Math.max(0.1, eye.far * factor)); draw(); };
  canvas.addEventListener("pointerdown", (e) => { held.set(e.pointerId, e); canvas.setPointerCapture(e.pointerId); });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => held.delete(e.pointerId));
  canvas.addEventListener("pointermove", (e) => {
    const before = held.get(e.pointerId);
    if (!before) return;
    const [dx, dy] = [e.clientX - before.clientX, e.clientY - before.clientY];
    if (held.size === 2) {
      const other = [...held.values()].find((each) => each.pointerId !== e.pointerId);
      const gap = (p) => Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY);
      nearer(Math.max(1, gap(before)) / Math.max(1, gap(e)));
      shift(dx / 2, dy / 2);
    } else if (e.buttons & 6 || e.shiftKey) shift(dx, dy);
    else turn(dx, dy);
    held.set(e.pointerId, e);
  });
  canvas.addEventListener("wheel", (e) => { e.preventDefault(); nearer(Math.exp(e.deltaY * 0.0012)); }, { passive: false });
  canvas.addEventListener("contextmenu", (e) => e.preventDefault());
  canvas.addEventListener("keydown", (e) => {
    const by = { ArrowLeft: [30, 0], ArrowRight: [-30, 0], ArrowUp: [0, 30], ArrowDown: [0, -30] }[e.key];
    if (by) (e.shiftKey ? shift : turn)(...by);
    else if (e.key === "+" || e.key === "-") nearer(e.key === "+" ? 0.85 : 1.18);
    else return;
    e.preventDefault();
  });
}

// Right and up in the picture, and towards the eye: directions in world (z up).
function axes(eye) {
  const [s, c, p, q] = [Math.sin(eye.yaw), Math.cos(eye.yaw), Math.sin(eye.pitch), Math.cos(eye.pitch)];
  return [[-s, c, 0], [-c * q, -s * q, p], [c * p, s * p, q]];
}

const LENS = 1.5;
const lens = (aspect) => LENS * Math.min(1, aspect * 0.9);

// From the direction that the page asks for, and from so far that the whole box is in the picture.
function whole(scene, aspect) {
  const [low, high] = scene.box, rows = axes(scene.eye), scale = lens(aspect) * 1.04;
  const at = low.map((x, i) => (x + high[i]) / 2);
  let far = 0.1;
  for (let corner = 0; corner < 8; corner++) {
    const from = at.map((x, i) => ((corner >> i) & 1 ? high : low)[i] - x);
    const [right, up, back] = rows.map((row) => row.reduce((sum, x, i) => sum + x * from[i], 0));
    far = Math.max(far, back + scale * Math.max(Math.abs(right) / aspect, Math.abs(up)));
  }
  return { ...scene.eye, at, far };
}

function view(eye, aspect) {
  const rows = axes(eye), near = eye.far * 0.02, end = eye.far * 50 + 200;
  const shift = rows.map((r) => -r.reduce((sum, x, i) => sum + x * eye.at[i], 0));
  shift[2] -= eye.far;
  const [r, u, b] = rows.map((row, i) => [...row, shift[i]]);
  const scale = lens(aspect), depth = (end + near) / (near - end), bias = (2 * end * near) / (near - end);
  const columns = [0, 1, 2, 3].map((i) => [(r[i] * scale) / aspect, u[i] * scale, b[i] * depth + (i === 3 ? bias : 0), -b[i]]);
  return new Float32Array(columns.flat());
}

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, "#version 300 es\nprecision highp float;\n" + text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.bindAttribLocation(made, 0, "a");
  gl.bindAttribLocation(made, 1, "b");
  gl.bindAttribLocation(made, 2, "kind");
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  return made;
}

function buffer(gl, data) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
  return array;
}

// Four planes of n numbers: x, y, z of the lowest corner in cells, each against the one before, and which side it is.
function facesArray(gl, data) {
  const n = data.length / 4, each = new Uint16Array(data.length);
  for (let k = 0; k < 4; k++) for (let i = 0, sum = 0; i < n; i++) each[4 * i + k] = sum = (sum + data[k * n + i]) & 65535;
  const array = buffer(gl, each);
  gl.enableVertexAttribArray(0);
  gl.vertexAttribPointer(0, 4, gl.UNSIGNED_SHORT, false, 8, 0);
  gl.vertexAttribDivisor(0, 1);
  return array;
}

function linesArray(gl, data) {
  const array = buffer(gl, data);
  for (const [place, count, offset] of [[0, 3, 0], [1, 3, 12], [2, 1, 24]]) {
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, count, gl.FLOAT, false, 28, offset);
    gl.vertexAttribDivisor(place, 1);
  }
  return array;
}

const FACES = `in vec4 a; uniform mat4 matrix; uniform vec3 origin; uniform vec3 eye; uniform float cell; out vec2 place; out float z;
flat out float shade;
void main() {
  place = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  int side = int(a.w), axis = side >> 1;
  vec3 corner = axis == 0 ? vec3(0, place) : axis == 1 ? vec3(place.y, 0, place.x) : vec3(place, 0);
  vec3 at = origin + (a.xyz + corner) * cell;
  shade = side == 5 ? 1.0 : side == 4 ? 0.45 : axis == 0 ? 0.82 : 0.68;
  z = origin.z + (a.z + (axis == 2 ? (side == 5 ? -0.5 : 0.5) : 0.5)) * cell;
  // A face that looks away is not drawn: it costs time, and none is seen through.
  bool away = ((side & 1) == 1) != (eye[axis] > origin[axis] + a[axis] * cell);
  gl_Position = away ? vec4(2, 2, 2, 1) : matrix * vec4(at, 1);
}`;
const LIT = `in vec2 place; in float z; flat in float shade; uniform vec2 heights; uniform vec3 palette[9]; out vec4 colour;
void main() {
  float share = clamp((z - heights.x) / (heights.y - heights.x), 0.0, 1.0) * 7.999;
  int k = int(share);
  vec2 border = min(place, 1.0 - place) / fwidth(place);
  float edge = mix(0.8, 1.0, smoothstep(0.0, 1.2, min(border.x, border.y)));
  float size = 1.0 / max(max(fwidth(place).x, fwidth(place).y), 1e-4);
  colour = vec4(mix(palette[k], palette[k + 1], fract(share)) * shade * mix(1.0, edge, clamp(size / 6.0 - 0.5, 0.0, 1.0)), 1);
}`;
const LINES = `in vec3 a; in vec3 b; in float kind; uniform mat4 matrix; uniform vec2 size; uniform vec4 colours[4];
uniform float widths[4]; flat out vec4 paint;
void main() {
  vec4 p = matrix * vec4(a, 1), q = matrix * vec4(b, 1);
  float near = 0.001;
  if (p.w < near) p = mix(p, q, (near - p.w) / max(q.w - p.w, 1e-6));
  if (q.w < near) q = mix(q, p, (near - q.w) / max(p.w - q.w, 1e-6));
  vec2 along = (q.xy / max(q.w, near) - p.xy / max(p.w, near)) * size;
  along = length(along) > 1e-6 ? normalize(along) : vec2(1, 0);
  int k = int(kind + 0.5);
  vec4 at = gl_VertexID < 2 ? p : q;
  vec2 off = vec2(-along.y, along.x) * (gl_VertexID % 2 == 0 ? 1.0 : -1.0) + along * (gl_VertexID < 2 ? -0.5 : 0.5);
  gl_Position = at + vec4(off * widths[k] / size * at.w, -1e-4 * float((4 - k) % 4) * at.w, 0);
  paint = vec4(colours[k].rgb * colours[k].a, colours[k].a);
}`;
const PLAIN = `flat in vec4 paint; out vec4 colour; void main() { colour = paint; }`;
