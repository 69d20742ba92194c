"use strict";
// Draws what is in space with WebGL: the map's points and surfaces, ways, keyframes, the robot and its uncertainty. x forward, y
// left, z up [m]; q is x, y, z, w. Seen by a camera that turns about a place, by default the robot's.
const Scene = (() => {
  const FIELD_OF_VIEW = 0.9, NEAREST_M = 0.5, FARTHEST_M = 2000;
  const BODY_M = [0.325, 0.14, 0.08];  // half of a Go2's trunk

  const add = (a, b) => a.map((v, i) => v + b[i]);
  const rotate = (q, v) => {
    const [x, y, z, w] = q;
    const t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])];
    return [v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2], v[2] + w * t[2] + x * t[1] - y * t[0]];
  };
  // T_a_b applied to a point in b.
  const moved = (p, q, v) => add(p, rotate(q, v));
  const product = (a, b) => [
    a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1], a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
    a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3], a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]];

  // 4 x 4 matrices by columns, as WebGL takes them.
  const multiply = (a, b) => {
    const c = new Float32Array(16);
    for (let col = 0; col < 4; ++col) {
      for (let row = 0; row < 4; ++row) {
        for (let k = 0; k < 4; ++k) c[4 * col + row] += a[4 * k + row] * b[4 * col + k];
      }
    }
    return c;
  };
  const ofPose = (p, q) => {
    const [x, y, z] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => rotate(q, axis));
    return new Float32Array([...x, 0, ...y, 0, ...z, 0, ...p, 1]);
  };
  const IDENTITY = ofPose([0, 0, 0], [0, 0, 0, 1]);

  // The lower triangular root of a symmetric 3 x 3 matrix: it turns a unit sphere into the matrix's ellipsoid.
  function root(m) {
    const l = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
    for (let i = 0; i < 3; ++i) {
      for (let j = 0; j <= i; ++j) {
        let sum = m[i][j];
        for (let k = 0; k < j; ++k) sum -= l[i][k] * l[j][k];
        l[i][j] = i === j ? Math.sqrt(Math.max(sum, 0)) : l[j][j] > 0 ? sum / l[j][j] : 0;
      }
    }
    return l;
  }

  // Three rings of the ellipsoid of `deviations` standard deviations, as pieces of lines.
  function ellipsoid(covariance, deviations) {
    const l = root(covariance), points = [], pieces = 48;
    const at = (a, b, i) => {
      const unit = [0, 0, 0];
      unit[a] = deviations * Math.cos(2 * Math.PI * i / pieces);
      unit[b] = deviations * Math.sin(2 * Math.PI * i / pieces);
      return l.map((row) => row[0] * unit[0] + row[1] * unit[1] + row[2] * unit[2]);
    };
    for (const [a, b] of [[0, 1], [0, 2], [1, 2]]) {
      for (let i = 0; i < pieces; ++i) points.push(...at(a, b, i), ...at(a, b, i + 1));
    }
    return points;
  }

  // The trunk as the edges of a box, its front crossed.
  function body() {
    const corner = (i) => BODY_M.map((half, axis) => (i >> axis & 1 ? half : -half));
    const edges = [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7], [1, 7], [3, 5]];
    return edges.flatMap(([a, b]) => [...corner(a), ...corner(b)]);
  }

  const VERTEX = `
    attribute vec3 position;
    attribute vec3 normal;
    uniform mat4 model, view;
    uniform vec3 eye, color, high;
    uniform vec2 heights;
    uniform float size;
    varying vec3 shade;
    void main() {
      vec4 world = model * vec4(position, 1.0);
      gl_Position = view * world;
      gl_PointSize = clamp(size / gl_Position.w, 1.5, 12.0);
      float part = heights.y > heights.x ? clamp((world.z - heights.x) / (heights.y - heights.x), 0.0, 1.0) : 0.0;
      float lit = dot(normal, normal) > 0.25 ? 0.55 + 0.45 * abs(dot(normalize(mat3(model) * normal), normalize(eye - world.xyz))) : 1.0;
      shade = mix(color, high, part) * lit;
    }`;
  const FRAGMENT = `
    precision mediump float;
    varying vec3 shade;
    void main() { gl_FragColor = vec4(shade, 1.0); }`;

  function program(gl) {
    const made = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    }
    gl.bindAttribLocation(made, 0, "position");
    gl.bindAttribLocation(made, 1, "normal");
    gl.linkProgram(made);
    return made;
  }

  // #rrggbb as three numbers from 0 to 1.
  const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);

  function camera() {
    const at = {yaw: -2.6, pitch: 0.6, far_m: 6, center: [0, 0, 0]};
    const eye = () => add(at.center, [
      at.far_m * Math.cos(at.pitch) * Math.cos(at.yaw), at.far_m * Math.cos(at.pitch) * Math.sin(at.yaw), at.far_m * Math.sin(at.pitch)]);
    const sides = () => {
      const ahead = [-Math.cos(at.pitch) * Math.cos(at.yaw), -Math.cos(at.pitch) * Math.sin(at.yaw), -Math.sin(at.pitch)];
      const right = [-Math.sin(at.yaw), Math.cos(at.yaw), 0];
      const up = [right[1] * ahead[2], -right[0] * ahead[2], right[0] * ahead[1] - right[1] * ahead[0]];
      return {right, up, ahead};
    };
    const matrix = (aspect) => {
      const {right, up, ahead} = sides(), e = eye();
      const dot = (a) => a[0] * e[0] + a[1] * e[1] + a[2] * e[2];
      const look = new Float32Array([right[0], up[0], -ahead[0], 0, right[1], up[1], -ahead[1], 0, right[2], up[2], -ahead[2], 0,
        -dot(right), -dot(up), dot(ahead), 1]);
      const f = 1 / Math.tan(FIELD_OF_VIEW / 2), near = at.far_m / 100, far = at.far_m * 100;
      const lens = new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (near + far) / (near - far), -1,
        0, 0, 2 * near * far / (near - far), 0]);
      return multiply(lens, look);
    };
    return {at, eye, sides, matrix};
  }

  // Turns by dragging; moves with two fingers, the right button or Shift; zooms with the wheel or by pinching.
  function steer(canvas, {at, sides}, changed, movedAway) {
    const fingers = new Map();
    const zoom = (factor) => {
      at.far_m = Math.min(FARTHEST_M, Math.max(NEAREST_M, at.far_m * factor));
    };
    const move = (dx, dy) => {
      const metres = at.far_m * Math.tan(FIELD_OF_VIEW / 2) * 2 / canvas.clientHeight;
      const {right, up} = sides();
      at.center = at.center.map((v, i) => v - right[i] * dx * metres + up[i] * dy * metres);
      movedAway();
    };
    canvas.addEventListener("pointerdown", (e) => {
      fingers.set(e.pointerId, [e.offsetX, e.offsetY]);
      canvas.setPointerCapture(e.pointerId);
    });
    canvas.addEventListener("pointermove", (e) => {
      const last = fingers.get(e.pointerId);
      if (!last) return;
      const now = [e.offsetX, e.offsetY], [dx, dy] = [now[0] - last[0], now[1] - last[1]];
      const other = [...fingers].find(([id]) => id !== e.pointerId);
      if (other) {
        const gap = (p) => Math.hypot(p[0] - other[1][0], p[1] - other[1][1]) || 1;
        zoom(gap(last) / gap(now));
        move(dx / 2, dy / 2);
      } else if (e.shiftKey || e.buttons & 2) {
        move(dx, dy);
      } else {
        at.yaw -= dx * 0.008;
        at.pitch = Math.min(1.57, Math.max(-0.2, at.pitch + dy * 0.008));
      }
      fingers.set(e.pointerId, now);
      changed();
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => fingers.delete(e.pointerId));
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("wheel", (e) => {
      e.preventDefault();
      zoom(Math.exp(e.deltaY * 0.001));
      changed();
    }, {passive: false});
  }

  // Lines a power of ten apart on the floor z = 0, about what is looked at.
  function grid({at}) {
    const step = 10 ** Math.ceil(Math.log10(at.far_m / 15)), reach = 20, points = [];
    const [x0, y0] = [0, 1].map((i) => Math.round(at.center[i] / step) * step);
    for (let i = -reach; i <= reach; ++i) {
      points.push(x0 + i * step, y0 - reach * step, 0, x0 + i * step, y0 + reach * step, 0);
      points.push(x0 - reach * step, y0 + i * step, 0, x0 + reach * step, y0 + i * step, 0);
    }
    return {step, points};
  }

  // Returns {set, pose, draw, follow, top, step}; null where the browser has no WebGL.
  function create(canvas) {
    const gl = canvas.getContext("webgl", {antialias: true, alpha: true});
    if (!gl) return null;
    const shader = program(gl);
    const place = (name) => gl.getUniformLocation(shader, name);
    const uniforms = Object.fromEntries(["model", "view", "eye", "color", "high", "heights", "size"].map((n) => [n, place(n)]));
    const layers = new Map();
    const eyes = camera();
    const state = {following: true, step: 1};

    // Shows `data` (x y z of each point, with normals behind each where `normals`) under this name. `kind` is POINTS, LINES or
    // LINE_STRIP; `color`, and `high` where heights are told by colours, name the page's colours or are #rrggbb.
    function set(name, data, {kind = "LINES", color, high, heights, normals = false, model = IDENTITY}) {
      const old = layers.get(name);
      const layer = {kind, color, high, heights, normals, model, buffer: old ? old.buffer : gl.createBuffer(), count: data.length / (normals ? 6 : 3)};
      gl.bindBuffer(gl.ARRAY_BUFFER, layer.buffer);
      gl.bufferData(gl.ARRAY_BUFFER, data instanceof Float32Array ? data : new Float32Array(data), gl.DYNAMIC_DRAW);
      layers.set(name, layer);
    }

    function drawLayer(layer, colorOf, height) {
      const stride = layer.normals ? 24 : 12;
      gl.bindBuffer(gl.ARRAY_BUFFER, layer.buffer);
      gl.enableVertexAttribArray(0);
      gl.vertexAttribPointer(0, 3, gl.FLOAT, false, stride, 0);
      if (layer.normals) {
        gl.enableVertexAttribArray(1);
        gl.vertexAttribPointer(1, 3, gl.FLOAT, false, stride, 12);
      } else {
        gl.disableVertexAttribArray(1);
        gl.vertexAttrib3f(1, 0, 0, 0);
      }
      gl.uniformMatrix4fv(uniforms.model, false, layer.model);
      gl.uniform3fv(uniforms.color, colorOf(layer.color));
      gl.uniform3fv(uniforms.high, colorOf(layer.high || layer.color));
      gl.uniform2fv(uniforms.heights, layer.heights || [0, 0]);
      gl.uniform1f(uniforms.size, 0.035 * height / Math.tan(FIELD_OF_VIEW / 2) / 2);
      gl.drawArrays(gl[layer.kind], 0, layer.count);
    }

    function draw() {
      const ratio = window.devicePixelRatio || 1;
      const [w, h] = [canvas.clientWidth, canvas.clientHeight].map((v) => Math.round(v * ratio));
      if (w === 0 || h === 0) return;
      if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
      const style = getComputedStyle(canvas);
      const colorOf = (name) => rgb(name.startsWith("--") ? style.getPropertyValue(name).trim() : name);
      const floor = grid(eyes);
      state.step = floor.step;
      set("grid", floor.points, {color: "--grid"});
      gl.viewport(0, 0, w, h);
      gl.clearColor(...colorOf("--panel"), 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      gl.useProgram(shader);
      gl.uniformMatrix4fv(uniforms.view, false, eyes.matrix(w / h));
      gl.uniform3fv(uniforms.eye, eyes.eye());
      let vertices = 0;
      for (const layer of layers.values()) {
        drawLayer(layer, colorOf, h);
        vertices += layer.count;
      }
      canvas.dataset.vertices = vertices;  // for tests: a picture cannot be asked
    }

    // Where the robot is: T_map_base, and the covariance of its position in a frame that q_map turns into the map's.
    function pose(p, q, covariance, q_map) {
      const model = ofPose(p, q);
      set("robot", body(), {color: "--text", model});
      [["#d02020", [0.5, 0, 0]], ["#10a040", [0, 0.3, 0]], ["#3a6cf0", [0, 0, 0.3]]].forEach(([color, tip], i) => {
        set(`axis${i}`, [0, 0, 0, ...tip], {color, model});
      });
      set("deviation", ellipsoid(covariance, 3), {color: "--bad", model: ofPose(p, q_map)});
      if (state.following) eyes.at.center = p;
    }

    const follow = () => {
      state.following = true;
    };
    const top = () => {
      [eyes.at.yaw, eyes.at.pitch] = [-Math.PI, 1.57];
    };
    // Looks at all that lies between two corners.
    const frame = (low, high) => {
      eyes.at.center = low.map((v, i) => (v + high[i]) / 2);
      eyes.at.far_m = Math.max(NEAREST_M, 0.9 * Math.hypot(...low.map((v, i) => high[i] - v)));
      state.following = false;
    };
    steer(canvas, eyes, draw, () => {
      state.following = false;
    });
    new ResizeObserver(draw).observe(canvas);
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
    return {set, pose, draw, follow, top, frame, state, gl};
  }

  return {create, moved, product, ofPose, rotate};
})();
