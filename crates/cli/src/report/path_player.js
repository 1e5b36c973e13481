'use strict';
// Plays paths one after the other: `data` has surfaces (micrometres), and acts: which parts move,
// which stay, and the poses of those that move.
const canvas = document.getElementById('view');
const gl = canvas.getContext('webgl', { antialias: true, alpha: false });
const slider = document.getElementById('at');
const said = document.getElementById('said');
const ten = document.getElementById('ten');
const frames = data.acts.flatMap((act) => act.poses.map((pose) => ({ act, pose })));
slider.max = Math.max(0, frames.length - 1);
slider.step = 'any';
// In which all of it is played, seconds.
const lasts = 4 * Math.max(1, data.acts.length);

function flat(surface) {
  const out = [];
  const p = (i) => [0, 1, 2].map((k) => surface.points[3 * i + k] * 1e-6);
  for (let t = 0; t < surface.triangles.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => p(surface.triangles[t + k]));
    const u = b.map((x, k) => x - a[k]);
    const v = c.map((x, k) => x - a[k]);
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const l = Math.hypot(...n) || 1;
    for (const q of [a, b, c]) out.push(...q, ...n.map((x) => x / l));
  }
  return new Float32Array(out);
}

function turned([x, y, z, w], v) {
  const cross = (a, b) => [0, 1, 2].map((k) => {
    const [i, j] = [(k + 1) % 3, (k + 2) % 3];
    return a[i] * b[j] - a[j] * b[i];
  });
  const q = [x, y, z];
  const inner = cross(q, v).map((c, k) => c + w * v[k]);
  return cross(q, inner).map((c, k) => v[k] + 2 * c);
}

function extent(surfaces) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (const surface of surfaces) {
    surface.points.forEach((x, i) => {
      low[i % 3] = Math.min(low[i % 3], x * 1e-6);
      high[i % 3] = Math.max(high[i % 3], x * 1e-6);
    });
  }
  return [low, high];
}

function program() {
  const shader = (kind, text) => {
    const s = gl.createShader(kind);
    gl.shaderSource(s, text);
    gl.compileShader(s);
    return s;
  };
  const made = gl.createProgram();
  gl.attachShader(made, shader(gl.VERTEX_SHADER, `
    attribute vec3 place, normal; uniform vec4 turn; uniform vec3 shift, middle;
    uniform mat3 view; uniform vec3 scale; varying float light;
    vec3 turned(vec4 q, vec3 v) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v); }
    void main() {
      vec3 p = view * (turned(turn, place) + shift - middle) * scale;
      vec3 n = view * turned(turn, normal);
      light = 0.35 + 0.65 * abs(dot(n, normalize(vec3(0.3, 0.5, 0.8))));
      gl_Position = vec4(p.xy, -0.2 * p.z, 1.0);
    }`));
  gl.attachShader(made, shader(gl.FRAGMENT_SHADER, `
    precision mediump float; varying float light; uniform vec4 colour;
    void main() { gl_FragColor = vec4(colour.rgb * light, colour.a); }`));
  gl.linkProgram(made);
  gl.useProgram(made);
  return made;
}

const prog = gl && program();
const at = (name) => gl.getUniformLocation(prog, name);
const buffers = [];
const shown = data.acts.length ? data.acts[0].staying : data.parts.map((_, part) => part);
const box = extent(shown.map((part) => data.parts[part]));
const middle = [0, 1, 2].map((k) => 0.5 * (box[0][k] + box[1][k]));
const size = Math.hypot(...[0, 1, 2].map((k) => box[1][k] - box[0][k]));
let reach = 0.5 * size;
for (const act of data.acts) {
  // What moves lies in a ball about the middle of its box.
  const [low, high] = extent(act.moving.map((part) => data.parts[part]));
  const own = low.map((x, k) => 0.5 * (x + high[k]));
  const radius = 0.5 * Math.hypot(...low.map((x, k) => high[k] - x));
  for (const { pose } of act.poses) {
    const there = turned(pose.slice(3), own).map((x, k) => x + pose[k] - middle[k]);
    reach = Math.max(reach, Math.hypot(...there) + radius);
  }
}
let zoom = 0.48 / reach;
let [yaw, pitch] = [0.7, -1.0];

if (gl) {
  for (const [part, surface] of data.parts.entries()) {
    const values = flat(surface);
    buffers[part] = { buffer: gl.createBuffer(), count: values.length / 6 };
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers[part].buffer);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
  }
}

function paint(part, pose, colour) {
  gl.bindBuffer(gl.ARRAY_BUFFER, buffers[part].buffer);
  for (const [i, attribute] of ['place', 'normal'].entries()) {
    const where = gl.getAttribLocation(prog, attribute);
    gl.enableVertexAttribArray(where);
    gl.vertexAttribPointer(where, 3, gl.FLOAT, false, 24, 12 * i);
  }
  gl.uniform3fv(at('shift'), pose.slice(0, 3));
  gl.uniform4fv(at('turn'), pose.slice(3));
  gl.uniform4fv(at('colour'), colour);
  gl.drawArrays(gl.TRIANGLES, 0, buffers[part].count);
}

// Where the parts that move are between two poses of one act.
function between(from, to, share) {
  const same = from.slice(3).reduce((sum, x, k) => sum + x * to[3 + k], 0) < 0 ? -1 : 1;
  const mixed = from.map((x, k) => x + share * ((k < 3 ? 1 : same) * to[k] - x));
  const length = Math.hypot(...mixed.slice(3));
  return mixed.map((x, k) => (k < 3 ? x : x / length));
}

function draw() {
  const value = Number(slider.value);
  const [before, after] = [frames[Math.floor(value)], frames[Math.ceil(value)]];
  const frame = frames[Math.round(value)];
  const pose = frame && frame.pose;
  const here = frame && before.act === after.act
    ? between(before.pose.pose, after.pose.pose, value - Math.floor(value))
    : pose && pose.pose;
  const act = frame ? frame.act : { moving: [], staying: shown, poses: [] };
  if (pose) {
    const force = pose.force
      ? `, ${(1e3 * pose.force[0]).toFixed(4)} mJ, ${pose.force[1].toFixed(3)} N`
      : '';
    const what = data.acts.length > 1 ? `${act.said}: ` : '';
    said.textContent = `${what}${(1e3 * pose.length).toFixed(2)} mm ${data.towards}, overlap `
      + `${(1e3 * pose.overlap).toFixed(4)} mm${force}`;
  }
  if (!gl) return;
  canvas.width = canvas.clientWidth * devicePixelRatio;
  canvas.height = canvas.clientHeight * devicePixelRatio;
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.clearColor(1, 1, 1, 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST);
  gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  gl.uniformMatrix3fv(at('view'), false, [cy, sy * cp, sy * sp, -sy, cy * cp, cy * sp, 0, -sp, cp]);
  const ratio = canvas.width / canvas.height;
  gl.uniform3fv(at('scale'), [zoom * 2 / ratio, zoom * 2, zoom * 2]);
  gl.uniform3fv(at('middle'), middle);
  const last = act.poses.length - 1;
  const drawn = ten.checked && last > 0
    ? Array.from({ length: 10 }, (_, i) => act.poses[Math.round((last * i) / 9)].pose)
    : [here];
  for (const one of drawn) {
    if (one) for (const part of act.moving) paint(part, one, [0.85, 0.45, 0.15, 1]);
  }
  gl.enable(gl.BLEND);
  gl.depthMask(false);
  for (const part of act.staying) paint(part, [0, 0, 0, 0, 0, 0, 1], [0.3, 0.45, 0.7, 0.45]);
  gl.depthMask(true);
  gl.disable(gl.BLEND);
}

let playing = false;
let ticked = 0;
document.getElementById('play').onclick = () => {
  playing = !playing;
  if (playing && slider.value === slider.max) slider.value = 0;
  ticked = performance.now();
  step();
};
function step() {
  document.getElementById('play').textContent = playing ? 'stop' : 'play';
  draw();
  if (!playing) return;
  const now = performance.now();
  slider.value = Number(slider.value) + ((now - ticked) / 1000 / lasts) * Number(slider.max);
  ticked = now;
  playing = slider.value !== slider.max;
  requestAnimationFrame(step);
}
canvas.onpointermove = (e) => {
  if (!e.buttons) return;
  yaw += 0.01 * e.movementX;
  pitch += 0.01 * e.movementY;
  draw();
};
canvas.onwheel = (e) => {
  e.preventDefault();
  zoom *= Math.exp(-0.001 * e.deltaY);
  draw();
};
slider.oninput = draw;
ten.onchange = draw;
onresize = draw;
draw();
