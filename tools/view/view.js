"use strict";
// Shows what the events of this page's server say (docs/view.md). Every text is set as text, never as markup.
(() => {
  const KEPT_S = 120, WAY_STEP_M = 0.02, STAGES_DRAWN = 5;
  const COLORS = [[0, 0.45, 0.7], [0.84, 0.37, 0], [0, 0.62, 0.45], [0.8, 0.47, 0.65], [0.34, 0.71, 0.91]];
  const POSED = ["TRACKING", "DEGRADED", "RELOCALISING"];
  const byId = (id) => document.getElementById(id);
  const scene = Scene.create(byId("scene"));
  if (!scene) byId("legend").textContent = "This browser has no WebGL: the view in space is left out.";

  const series = (label, i) => ({label, color: COLORS[i], width: 1.6, dashed: false, x: [], y: []});
  const axesOf = (title, y_label, labels) => ({title, x_label: "time ago (s)", y_label, from_zero: true, series: labels.map(series)});
  const axes = {
    latency: axesOf("Latency", "ms", ["frame's arrival to here", "exposure to arrival"]),
    sigma: axesOf("Claimed deviation", "cm", ["of the position"]),
    quality: axesOf("Quality", "0 to 100", ["quality"]),
    inliers: axesOf("What carries the pose", "inliers", ["visual", "depth"]),
    clock: axesOf("Clock of the camera", "ms", ["bound of the error"]),
    wall: axesOf("Wall clock against the monotonic", "ms", ["since the page began"]),
    stages: axesOf("Stages", "ms", []),
  };
  axes.wall.from_zero = false;
  const redraw = {};
  // A plot's legend is made with it: that of the stages when the stages are known.
  const addPlot = (name) => {
    redraw[name] = Plot.add(byId("plots"), axes[name], []);
  };

  const tiles = new Map();
  function tile(label, value, note) {
    if (!tiles.has(label)) {
      const box = Plot.element("div", label.startsWith("Position") ? "tile wide" : "tile");
      const parts = [Plot.element("small", "", label), Plot.element("b"), Plot.element("small")];
      box.append(...parts);
      byId("tiles").append(box);
      tiles.set(label, parts);
    }
    const [, big, small] = tiles.get(label);
    big.textContent = value;
    small.textContent = note;
  }

  function table(element, columns, rows) {
    const head = Plot.element("tr");
    columns.forEach((name) => head.append(Plot.element("th", "", name)));
    element.replaceChildren(head);
    for (const row of rows) {
      const line = Plot.element("tr");
      row.forEach(([text, className]) => line.append(Plot.element("td", className || "", text)));
      element.append(line);
    }
  }

  // Histories are kept by absolute time and shown by how long ago it was.
  const history = new Map();
  function remember(name, i, t_s, value) {
    const key = `${name} ${i}`;
    if (!history.has(key)) history.set(key, []);
    const kept = history.get(key);
    if (kept.length && t_s < kept[kept.length - 1][0]) kept.length = 0;
    kept.push([t_s, value]);
    while (kept[0][0] < t_s - KEPT_S) kept.shift();
  }
  function fillAxes() {
    const newest = Math.max(...[...history.values()].map((kept) => kept[kept.length - 1][0]));
    for (const [name, one] of Object.entries(axes)) {
      one.series.forEach((s, i) => {
        const kept = history.get(`${name} ${i}`) || [];
        s.x = kept.map(([t]) => t - newest);
        s.y = kept.map(([, value]) => value);
      });
    }
  }

  const counted = {poses: 0, since: performance.now(), rate: 0};
  function countPose() {
    counted.poses += 1;
    const now = performance.now();
    if (now - counted.since > 1000) {
      counted.rate = counted.poses * 1000 / (now - counted.since);
      counted.poses = 0;
      counted.since = now;
    }
  }

  const inMetres = (m) => (m < 1 ? `${(100 * m).toFixed(1)} cm` : `${m.toPrecision(3)} m`);
  const inSeconds = (ms) => (ms < 1000 ? `${ms.toFixed(0)} ms` : `${(ms / 1000).toPrecision(3)} s`);

  // The upper triangle of the covariance by rows, x y z first.
  const positionCovariance = (c) => [[c[0], c[1], c[2]], [c[1], c[6], c[7]], [c[2], c[7], c[11]]];

  const shown = {way: [], pose: null, map: null, newest_s: null, dirty: false, plotsDirty: false, wall_ns: null};
  function showPose(pose, sigma, p) {
    const {p_map_odom, q_map_odom} = pose;
    shown.pose = {p, q: Scene.product(q_map_odom, pose.q_odom_base), p_map_odom, q_map_odom, sigma};
    const last = shown.way[shown.way.length - 1];
    if (!last || Math.hypot(...last.map((v, i) => v - pose.p_odom_base[i])) > WAY_STEP_M) shown.way.push(pose.p_odom_base);
    shown.dirty = true;
  }

  function onPose(pose) {
    countPose();
    const sigma = positionCovariance(pose.covariance);
    const sigma_m = Math.sqrt(sigma[0][0] + sigma[1][1] + sigma[2][2]);
    const latency_ms = pose.unpaced ? null : (pose.t_received_ns - pose.t_arrival_ns) / 1e6;
    const p = Scene.moved(pose.p_map_odom, pose.q_map_odom, pose.p_odom_base);
    if (POSED.includes(pose.status)) showPose(pose, sigma, p);
    if (shown.wall_ns === null) shown.wall_ns = pose.realtime_minus_mono_ns;
    const t_s = pose.t_received_ns / 1e9;
    shown.newest_s = t_s;
    remember("latency", 0, t_s, latency_ms);
    remember("latency", 1, t_s, (pose.t_arrival_ns - pose.t_capture_ns) / 1e6);
    remember("sigma", 0, t_s, POSED.includes(pose.status) ? 100 * sigma_m : null);
    remember("quality", 0, t_s, pose.quality);
    remember("inliers", 0, t_s, pose.visual_inliers);
    remember("inliers", 1, t_s, pose.depth_inliers);
    remember("clock", 0, t_s, pose.sync_error_bound_ns / 1e6);
    remember("wall", 0, t_s, (pose.realtime_minus_mono_ns - shown.wall_ns) / 1e6);
    shown.plotsDirty = true;
    tile("Status", pose.status, pose.source === "none" ? "no first guess" : `first guess by ${pose.source}`);
    tile("Position in the map", p.map((v) => v.toFixed(2)).join("  "), "x y z (m)");
    tile("Deviation", inMetres(sigma_m), "claimed, of the position");
    tile("Latency", latency_ms === null ? "–" : inSeconds(latency_ms), latency_ms === null ? "the replay is not paced" : "from the frame's arrival");
    tile("Poses", `${counted.rate.toFixed(0)} / s`, `frame ${pose.frame}, ${pose.frames_dropped} dropped`);
    tile("Sensors", pose.sensors.join(" ") || "none", "that this pose was made from");
  }

  // The mean over what was added to a histogram since it was seen last.
  const seen = new Map();
  function recentMean(name, t) {
    const before = seen.get(name) || {count: 0, sum: 0};
    const now = {count: t.count, sum: t.count * t.mean};
    seen.set(name, now);
    return now.count > before.count ? (now.sum - before.sum) / (now.count - before.count) : null;
  }

  function onStatus(status) {
    byId("summary").textContent = status.summary || "\u00a0";
    const stateOf = health => health.state === "silent" && health.last_sample_s !== null
      ? `silent ${Math.floor(health.last_sample_s)} s` : health.state;
    const rows = Object.entries(status.health || {}).map(([name, health]) => [
      [name], [stateOf(health), health.state === "streaming" ? "good" : "bad"],
      [String(health.delivered)], [String(health.rejected)], [String(health.dropped)], [health.reason || "", "text"]]);
    const part = (name, trouble, fine, note) => rows.push([
      [name], [trouble ? "trouble" : fine, trouble ? "bad" : "good"], [""], [""], [""], [trouble || note, "text"]]);
    const {source, map} = status;
    if (source) part("source", source.trouble, source.open ? "open" : "opening", source.path || source.format || "");
    if (map && map.file) part("map file", map.trouble, map.saved_s === null ? "not saved yet" : `saved ${Math.round(map.saved_s)} s ago`, map.file);
    table(byId("health"), ["", "state", "delivered", "rejected", "dropped", ""], rows);
    const stages = Object.entries(status.times_ms || {}).filter(([, t]) => t.count > 0);
    table(byId("times"), ["stage", "count", "p50 (ms)", "p99 (ms)", "max (ms)"], stages.map(([name, t]) => [
      [name], [String(t.count)], [t.p50.toFixed(2)], [t.p99.toFixed(2)], [t.max.toFixed(2)]]));
    rememberStages(stages);
  }

  let drawn = [];  // names of the stages that have a line
  function rememberStages(stages) {
    const means = new Map(stages.map(([name, t]) => [name, recentMean(name, t)]));
    if (!drawn.length && stages.length > STAGES_DRAWN) {
      const costly = stages.filter(([name]) => !name.includes("pose")).sort(([, a], [, b]) => b.mean - a.mean);
      drawn = costly.slice(0, STAGES_DRAWN).map(([name]) => name);
      axes.stages.series = drawn.map(series);
      addPlot("stages");
    }
    if (shown.newest_s !== null) drawn.forEach((name, i) => remember("stages", i, shown.newest_s, means.get(name) ?? null));
  }

  function onLink(link) {
    byId("link").textContent = link.up ? "live" : `no daemon: ${link.why}`;
    byId("link").className = `state ${link.up ? "up" : "down"}`;
    if (!link.up) seen.clear();
  }

  function onWay(way) {
    shown.way = way;
    shown.dirty = true;
  }

  // The map's binary form is in docs/view.md.
  async function onMap(about) {
    const answer = await fetch(`map${location.search}`, {cache: "no-store"});
    if (!answer.ok) return;
    const bytes = await answer.arrayBuffer();
    const counts = new Uint32Array(bytes, 8, 4);
    const widths = [7, 3, 6, 6];
    const lists = [];
    let at = 24;
    counts.forEach((count, i) => {
      lists.push(new Float32Array(bytes, at, count * widths[i]));
      at += count * widths[i] * 4;
    });
    shown.map = {about, keyframes: lists[0], points: lists[1], surfels: lists[2], loops: lists[3]};
    drawMap(shown.map);
    shown.dirty = true;
  }

  function heightsOf(list, width) {
    const z = [];
    for (let i = 2; i < list.length; i += width * Math.max(1, Math.floor(list.length / width / 5000))) z.push(list[i]);
    z.sort((a, b) => a - b);
    return z.length ? [z[Math.floor(z.length * 0.02)], z[Math.floor((z.length - 1) * 0.98)] + 1e-3] : [0, 0];
  }

  function drawMap(map) {
    if (!scene) return;
    const heights = heightsOf(map.surfels.length ? map.surfels : map.points, map.surfels.length ? 6 : 3);
    scene.set("surfels", map.surfels, {kind: "POINTS", color: "--low", high: "--high", heights, normals: true});
    scene.set("points", map.points, {kind: "POINTS", color: "--muted"});
    scene.set("loops", map.loops, {kind: "LINES", color: "--bad"});
    const marks = [];
    for (let i = 0; i < map.keyframes.length; i += 7) {
      const p = [...map.keyframes.slice(i, i + 3)], q = [...map.keyframes.slice(i + 3, i + 7)];
      const at = (v) => Scene.moved(p, q, v);
      const [nose, left, right] = [at([0.1, 0, 0]), at([-0.04, 0.05, 0]), at([-0.04, -0.05, 0])];
      marks.push(...nose, ...left, ...left, ...right, ...right, ...nose);
    }
    scene.set("keyframes", marks, {kind: "LINES", color: "--good"});
  }

  function legend() {
    const parts = [`grid ${scene.state.step} m`, "ellipsoid: 3 standard deviations"];
    const {map} = shown;
    if (run.frames.length) parts.push("blue: as said at its time, green: after all optimisation");
    if (map) parts.push(`map as saved: ${map.keyframes.length / 7} keyframes, ${map.points.length / 3} points, ${map.surfels.length / 6} surfaces, ${map.loops.length / 6} loops`);
    byId("legend").textContent = parts.join("  ·  ");
    byId("follow").setAttribute("aria-pressed", String(scene.state.following));
  }

  function drawScene() {
    if (shown.pose) {
      const {p, q, p_map_odom, q_map_odom, sigma} = shown.pose;
      scene.set("way", shown.way.flat(), {kind: "LINE_STRIP", color: "--accent", model: Scene.ofPose(p_map_odom, q_map_odom)});
      scene.pose(p, q, sigma, q_map_odom);
    }
    scene.draw();
    legend();
  }

  let lastPlots_ms = 0;
  function frame(now_ms) {
    if (scene && shown.dirty) {
      shown.dirty = false;
      drawScene();
    }
    if (shown.plotsDirty && now_ms - lastPlots_ms > 250) {
      shown.plotsDirty = false;
      lastPlots_ms = now_ms;
      fillAxes();
      Object.values(redraw).forEach((again) => again());
    }
    requestAnimationFrame(frame);
  }

  // A finished run (docs/view.md): its plots are whole, and the time line says which frame is shown.
  const run = {frames: [], at: 0, playing: null};
  function showFrame(i) {
    run.at = i;
    const frame = run.frames[i], p = frame.pose.slice(0, 3), q = frame.pose.slice(3), c = frame.covariance;
    const sigma = [[c[0], c[1], c[2]], [c[1], c[3], c[4]], [c[2], c[4], c[5]]];
    shown.pose = {p, q, p_map_odom: [0, 0, 0], q_map_odom: [0, 0, 0, 1], sigma};
    shown.way = run.frames.slice(0, i + 1).map((one) => one.pose.slice(0, 3));
    shown.dirty = true;
    byId("time").value = String(i);
    byId("now").textContent = `${frame.t_s.toFixed(2)} s`;
    tile("Status", frame.status, frame.source === "none" ? "no first guess" : `first guess by ${frame.source}`);
    tile("Position in the map", p.map((v) => v.toFixed(2)).join("  "), "x y z (m)");
    tile("Deviation", inMetres(Math.sqrt(c[0] + c[3] + c[5])), "claimed, of the position");
    tile("Quality", String(frame.quality), "0 to 100");
    tile("Frame", `${i + 1} / ${run.frames.length}`, "with a pose");
  }

  // Goes on at the pace of the recording until the end or the next click.
  function play() {
    const stop = () => {
      run.playing = null;
      byId("play").textContent = "Play";
    };
    if (run.playing) return stop();
    if (run.at === run.frames.length - 1) showFrame(0);
    const begun = {ms: performance.now(), t_s: run.frames[run.at].t_s};
    const token = run.playing = {};
    byId("play").textContent = "Pause";
    const go = (now_ms) => {
      if (run.playing !== token) return;
      const t_s = begun.t_s + (now_ms - begun.ms) / 1000;
      let i = run.at;
      while (i + 1 < run.frames.length && run.frames[i + 1].t_s <= t_s) ++i;
      if (i !== run.at) showFrame(i);
      if (i === run.frames.length - 1) stop();
      else requestAnimationFrame(go);
    };
    requestAnimationFrame(go);
  }

  function showRun(answer) {
    run.frames = answer.frames;
    byId("link").textContent = "a finished run";
    byId("link").className = "state up";
    byId("summary").textContent = answer.name;
    document.querySelectorAll(".live").forEach((part) => part.remove());
    byId("span").textContent = "The run";
    byId("timeline").hidden = false;
    byId("time").max = String(run.frames.length - 1);
    byId("time").addEventListener("input", () => {
      run.playing = null;
      byId("play").textContent = "Play";
      showFrame(Number(byId("time").value));
    });
    byId("play").addEventListener("click", play);
    const t = run.frames.map((one) => one.t_s);
    const plotOf = (title, y_label, value) => Plot.add(byId("plots"), {title, x_label: "time (s)", y_label, from_zero: true,
      series: [{...series("", 0), x: t, y: run.frames.map(value)}]}, []);
    plotOf("Claimed deviation", "cm", ({covariance: c}) => 100 * Math.sqrt(c[0] + c[3] + c[5]));
    plotOf("Quality", "0 to 100", (one) => one.quality);
    plotOf("Height", "m", (one) => one.pose[2]);
    if (scene) scene.set("final", answer.final.flat(), {kind: "LINE_STRIP", color: "--good"});
    showFrame(0);
    onMap({});
  }

  // All that there is to see, between two corners.
  function showAll() {
    const places = shown.way.map((p) => Scene.moved(shown.pose.p_map_odom, shown.pose.q_map_odom, p));
    const {map} = shown;
    places.push(...run.frames.map((one) => one.pose.slice(0, 3)));
    for (let i = 0; map && i < map.keyframes.length; i += 7) places.push([...map.keyframes.slice(i, i + 3)]);
    if (!places.length) return;
    const corner = (pick) => [0, 1, 2].map((i) => places.reduce((v, p) => pick(v, p[i]), places[0][i]));
    scene.frame(corner(Math.min), corner(Math.max));
    shown.dirty = true;
  }

  if (scene) {
    byId("follow").addEventListener("click", () => {
      scene.follow();
      shown.dirty = true;
    });
    byId("above").addEventListener("click", () => {
      scene.top();
      shown.dirty = true;
    });
    byId("whole").addEventListener("click", () => shown.pose && showAll());
  }

  function follow() {
    Object.keys(axes).filter((name) => name !== "stages").forEach(addPlot);
    const events = new EventSource(`events${location.search}`);
    for (const [name, take] of [["pose", onPose], ["status", onStatus], ["link", onLink], ["way", onWay], ["map", onMap]]) {
      events.addEventListener(name, (event) => take(JSON.parse(event.data)));
    }
    events.addEventListener("error", () => {
      byId("link").textContent = "geoflow view does not answer";
      byId("link").className = "state down";
    });
  }

  fetch(`run${location.search}`, {cache: "no-store"}).then((answer) => answer.json()).then((answer) => (answer.frames ? showRun(answer) : follow()), follow);
  requestAnimationFrame(frame);
})();
