'use strict';
// Shows parts in space and slides those that move along their paths: one picture for every element
// `.player`, whose script has the surfaces (micrometres) and acts: which parts move, which stay, and
// the poses of those that move.
const CREASE = Math.cos(0.5);

/** Corners with normals, and edges where faces meet at an angle: six numbers each. */
function flat(surface) {
  const p = (i) => [0, 1, 2].map((k) => surface.points[3 * i + k] * 1e-6);
  const faces = [];
  const around = new Map();
  const edges = new Map();
  for (let t = 0; t < surface.triangles.length; t += 3) {
    const corners = surface.triangles.slice(t, t + 3);
    const [a, b, c] = corners.map(p);
    const [u, v] = [b, c].map((q) => q.map((x, k) => x - a[k]));
    const n = cross(u, v);
    const face = { corners, n, one: unit(n) };
    faces.push(face);
    corners.forEach((corner, k) => {
      const next = corners[(k + 1) % 3];
      const key = Math.min(corner, next) + '/' + Math.max(corner, next);
      for (const [map, name] of [[around, corner], [edges, key]]) {
        if (!map.has(name)) map.set(name, []);
        map.get(name).push(face);
      }
    });
  }
  const out = [];
  for (const { corners, one } of faces) {
    for (const corner of corners) {
      const near = around.get(corner).filter((face) => dot(face.one, one) > CREASE);
      const sum = near.reduce((s, { n }) => s.map((x, k) => x + n[k]), [0, 0, 0]);
      out.push(...p(corner), ...unit(sum));
    }
  }
  const lines = [];
  for (const [key, both] of edges) {
    if (both.length === 2 && dot(both[0].one, both[1].one) > CREASE) continue;
    for (const end of key.split('/')) lines.push(...p(Number(end)), 0, 0, 0);
  }
  return [out, lines].map((list) => new Float32Array(list));
}

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a) => { const l = Math.hypot(...a) || 1; return a.map((x) => x / l); };
function cross(a, b) {
  return [0, 1, 2].map((k) => {
    const [i, j] = [(k + 1) % 3, (k + 2) % 3];
    return a[i] * b[j] - a[j] * b[i];
  });
}

function turned([x, y, z, w], v) {
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

/** Where the parts that move are between two poses of one act. */
function between(from, to, share) {
  const same = from.slice(3).reduce((sum, x, k) => sum + x * to[3 + k], 0) < 0 ? -1 : 1;
  const mixed = from.map((x, k) => x + share * ((k < 3 ? 1 : same) * to[k] - x));
  const length = Math.hypot(...mixed.slice(3));
  return mixed.map((x, k) => (k < 3 ? x : x / length));
}

/** A number with a minus sign, not a hyphen. */
const signed = (value, digits) => {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace('-', '') : text.replace('-', '\u2212');
};

const SHADERS = [`
  attribute vec3 place, normal; uniform vec4 turn; uniform vec3 shift, middle;
  uniform mat3 view; uniform vec3 scale; varying float light;
  vec3 turned(vec4 q, vec3 v) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v); }
  void main() {
    vec3 p = view * (turned(turn, place) + shift - middle) * scale;
    vec3 n = view * turned(turn, normal);
    light = dot(n, n) < 0.5 ? 1.0 : 0.45 + 0.55 * abs(dot(n, normalize(vec3(0.3, 0.5, 0.8))));
    gl_Position = vec4(p.xy, -0.2 * p.z, 1.0);
  }`, `
  precision mediump float; varying float light; uniform vec4 colour;
  void main() { gl_FragColor = vec4(colour.rgb * light * colour.a, colour.a); }`];

function program(gl) {
  const made = gl.createProgram();
  [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((kind, i) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, SHADERS[i]);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  });
  gl.linkProgram(made);
  gl.useProgram(made);
  return made;
}

/** The colours of the page, as numbers; they change with the page from light to dark. */
function colours() {
  const style = getComputedStyle(document.documentElement);
  const read = (name, alpha) => {
    const value = parseInt(style.getPropertyValue(`--${name}`).trim().slice(1), 16);
    return [16, 8, 0].map((bits) => ((value >> bits) & 255) / 255).concat(alpha);
  };
  return {
    moving: read('moving', 1), movingEdge: read('moving-edge', 1),
    fixed: read('fixed', 0.45), edge: read('edge', 0.6),
  };
}

/** What is in the picture: all parts at all poses, each as the ball about the middle of its box. */
function reachOf(data, shown) {
  const balls = [];
  const ball = (part, pose) => {
    const [low, high] = extent([data.parts[part]]);
    const own = low.map((x, k) => 0.5 * (x + high[k]));
    const there = turned(pose.slice(3), own).map((x, k) => x + pose[k]);
    balls.push([there, 0.5 * Math.hypot(...low.map((x, k) => high[k] - x))]);
  };
  for (const part of shown) ball(part, STILL);
  for (const act of data.acts) {
    for (const { pose } of act.poses) for (const part of act.moving) ball(part, pose);
  }
  const middle = [0, 1, 2].map((k) => 0.5 * (Math.min(...balls.map(([c, r]) => c[k] - r))
    + Math.max(...balls.map(([c, r]) => c[k] + r))));
  const far = ([c, r]) => Math.hypot(...c.map((x, k) => x - middle[k])) + r;
  // Balls are larger than what is in them.
  return [middle, 0.85 * Math.max(...balls.map(far))];
}

const STILL = [0, 0, 0, 0, 0, 0, 1];

/** Surfaces on the graphics card. */
class Picture {
  constructor(canvas, data) {
    this.canvas = canvas;
    this.gl = canvas.getContext('webgl', { antialias: true });
    const shown = data.acts.length ? data.acts[0].staying : data.parts.map((_, part) => part);
    const [middle, reach] = reachOf(data, shown);
    [this.middle, this.zoom, this.yaw, this.pitch] = [middle, 0.48 / reach, 0.7, -1.15];
    if (!this.gl) {
      canvas.hidden = true;
      const none = 'This browser draws nothing in space: it has no WebGL.';
      canvas.insertAdjacentHTML('beforebegin', `<p>${none}</p>`);
      return;
    }
    this.program = program(this.gl);
    this.buffers = data.parts.map((surface) => flat(surface).map((values) => {
      const buffer = this.gl.createBuffer();
      this.gl.bindBuffer(this.gl.ARRAY_BUFFER, buffer);
      this.gl.bufferData(this.gl.ARRAY_BUFFER, values, this.gl.STATIC_DRAW);
      return { buffer, count: values.length / 6 };
    }));
  }

  at(name) {
    return this.gl.getUniformLocation(this.program, name);
  }

  paint(part, pose, [face, edge]) {
    const { gl } = this;
    for (const [kind, { buffer, count }] of this.buffers[part].entries()) {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      for (const [i, attribute] of ['place', 'normal'].entries()) {
        const where = gl.getAttribLocation(this.program, attribute);
        gl.enableVertexAttribArray(where);
        gl.vertexAttribPointer(where, 3, gl.FLOAT, false, 24, 12 * i);
      }
      gl.uniform3fv(this.at('shift'), pose.slice(0, 3));
      gl.uniform4fv(this.at('turn'), pose.slice(3));
      gl.uniform4fv(this.at('colour'), kind === 0 ? face : edge);
      gl.drawArrays(kind === 0 ? gl.TRIANGLES : gl.LINES, 0, count);
    }
  }

  look() {
    const { gl, canvas, zoom } = this;
    canvas.width = canvas.clientWidth * devicePixelRatio;
    canvas.height = canvas.clientHeight * devicePixelRatio;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    const [cy, sy] = [Math.cos(this.yaw), Math.sin(this.yaw)];
    const [cp, sp] = [Math.cos(this.pitch), Math.sin(this.pitch)];
    gl.uniformMatrix3fv(this.at('view'), false,
      [cy, sy * cp, sy * sp, -sy, cy * cp, cy * sp, 0, -sp, cp]);
    const less = Math.min(canvas.width, canvas.height);
    gl.uniform3fv(this.at('scale'),
      [zoom * 2 * less / canvas.width, zoom * 2 * less / canvas.height, zoom * 2]);
    gl.uniform3fv(this.at('middle'), this.middle);
  }

  /** The parts of an act: those that move at every one of `poses`, the others see-through. */
  draw(act, poses) {
    if (!this.gl) return;
    this.look();
    const colour = colours();
    for (const pose of poses) {
      for (const part of act.moving) this.paint(part, pose, [colour.moving, colour.movingEdge]);
    }
    this.gl.depthMask(false);
    for (const part of act.staying) this.paint(part, STILL, [colour.fixed, colour.edge]);
    this.gl.depthMask(true);
  }
}

/** One finger or the mouse turns, two fingers, or Ctrl and the wheel, come nearer. */
function handle(picture, draw) {
  const { canvas } = picture;
  const fingers = new Map();
  const apart = () => {
    const [a, b] = [...fingers.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  };
  canvas.onpointerdown = (e) => {
    canvas.setPointerCapture(e.pointerId);
    fingers.set(e.pointerId, [e.clientX, e.clientY]);
  };
  canvas.onpointerup = canvas.onpointercancel = (e) => fingers.delete(e.pointerId);
  canvas.onpointermove = (e) => {
    const from = fingers.get(e.pointerId);
    if (!from) return;
    const before = fingers.size === 2 ? apart() : 0;
    fingers.set(e.pointerId, [e.clientX, e.clientY]);
    if (before > 0) picture.zoom *= apart() / before;
    else {
      picture.yaw += 0.01 * (e.clientX - from[0]);
      picture.pitch += 0.01 * (e.clientY - from[1]);
    }
    draw();
  };
  // A page is scrolled past a picture.
  canvas.addEventListener('wheel', (e) => {
    if (!e.ctrlKey) return;
    e.preventDefault();
    picture.zoom *= Math.exp(-0.002 * e.deltaY);
    draw();
  }, { passive: false });
}

/** The words under the picture. */
function words(data, { pose, act }) {
  const force = pose.force
    ? `, energy ${signed(1e3 * pose.force[0], 1)} mJ, force ${signed(pose.force[1], 2)} N` : '';
  const overlap = pose.overlap > 0 ? `, overlap ${signed(1e3 * pose.overlap, 4)} mm` : '';
  const what = data.acts.length > 1 ? `${act.said}: ` : '';
  const where = pose.time === undefined
    ? `${signed(1e3 * pose.length, 1)} mm ${data.towards}` : `${signed(pose.time, 2)} s`;
  return `${what}${where}${overlap}${force}`;
}

function player(root) {
  const data = JSON.parse(root.querySelector('script').textContent);
  const picture = new Picture(root.querySelector('canvas'), data);
  const slider = root.querySelector('input[type=range]');
  const ten = root.querySelector('input[type=checkbox]');
  const button = root.querySelector('button');
  const frames = data.acts.flatMap((act) => act.poses.map((pose) => ({ act, pose })));
  slider.max = Math.max(0, frames.length - 1);
  slider.step = 'any';
  slider.value = data.start;
  // In which all of it is played, seconds: what has times, in its own.
  const [first, last] = [frames[0], frames[frames.length - 1]].map((frame) => frame?.pose.time);
  const lasts = last - first || 4 * Math.max(1, data.acts.length);

  function draw() {
    if (frames.length === 0) {
      picture.draw({ moving: [], staying: data.parts.map((_, part) => part) }, []);
      return;
    }
    const value = Number(slider.value);
    const [before, after] = [frames[Math.floor(value)], frames[Math.ceil(value)]];
    const frame = frames[Math.round(value)];
    root.querySelector('.said').textContent = words(data, frame);
    const { act } = frame;
    const last = act.poses.length - 1;
    const here = before.act === after.act
      ? between(before.pose.pose, after.pose.pose, value - Math.floor(value)) : frame.pose.pose;
    picture.draw(act, ten.checked && last > 0
      ? Array.from({ length: 10 }, (_, i) => act.poses[Math.round((last * i) / 9)].pose) : [here]);
  }

  let playing = false;
  let ticked = 0;
  button.onclick = () => {
    playing = !playing;
    if (playing && slider.value === slider.max) slider.value = 0;
    ticked = performance.now();
    step();
  };
  function step() {
    button.textContent = playing ? 'stop' : 'play';
    draw();
    if (!playing) return;
    const now = performance.now();
    slider.value = Number(slider.value) + ((now - ticked) / 1000 / lasts) * Number(slider.max);
    ticked = now;
    playing = slider.value !== slider.max;
    requestAnimationFrame(step);
  }
  handle(picture, draw);
  slider.oninput = draw;
  ten.onchange = draw;
  new ResizeObserver(draw).observe(picture.canvas);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
  draw();
}

document.querySelectorAll('.player').forEach(player);
