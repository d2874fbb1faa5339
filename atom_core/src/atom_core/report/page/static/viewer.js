// The rig in three dimensions: draws the scene of the report with plotly.js. Where the browser
// cannot draw in three dimensions, the still picture stays.
(function () {
  "use strict";
  const scene = JSON.parse(document.getElementById("scene").textContent);
  const viewer = document.getElementById("viewer");
  const element = (name) => document.getElementById(name);

  function polylines(points) {
    const at = (axis) => points.map((point) => (point ? point[axis] : null));
    return { x: at(0), y: at(1), z: at(2) };
  }

  function outline(corners) {
    return [...corners, corners[0], null];
  }

  function limits() {
    const points = scene.boards.flatMap((board) => board.corners);
    for (const sensor of scene.sensors) {
      for (const lines of [sensor.before, sensor.after]) {
        points.push(...(lines || []).filter((point) => point));
      }
    }
    const axes = [0, 1, 2].map((axis) => {
      const values = points.map((point) => point[axis]);
      const low = Math.min(...values), high = Math.max(...values);
      const margin = 0.08 * (high - low) + scene.size_m;
      return [low - margin, high + margin];
    });
    return points.length ? axes : [[-1, 1], [-1, 1], [-1, 1]];
  }
  const ranges = limits();

  function decoded(text) {
    const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
    const numbers = new Int16Array(bytes.buffer), axes = [[], [], []];
    for (let i = 0; i < numbers.length; i += 3) {
      const point = [0, 1, 2].map((axis) => numbers[i + axis] * scene.unit_m);
      if (point.every((value, axis) => value >= ranges[axis][0] && value <= ranges[axis][1])) {
        point.forEach((value, axis) => axes[axis].push(value));
      }
    }
    return { x: axes[0], y: axes[1], z: axes[2] };
  }

  function ball(ellipsoid, colour, name) {
    const rings = 8, sides = 14, x = [], y = [], z = [], i = [], j = [], k = [];
    for (let ring = 0; ring <= rings; ring++) {
      for (let side = 0; side < sides; side++) {
        const down = (Math.PI * ring) / rings, round = (2 * Math.PI * side) / sides;
        const unit = [
          Math.sin(down) * Math.cos(round), Math.sin(down) * Math.sin(round), Math.cos(down),
        ];
        const point = [0, 1, 2].map((axis) => ellipsoid.centre[axis] +
          unit.reduce((sum, value, n) => sum + value * ellipsoid.axes[n][axis], 0));
        x.push(point[0]); y.push(point[1]); z.push(point[2]);
        if (ring < rings) {
          const here = ring * sides + side, next = ring * sides + ((side + 1) % sides);
          i.push(here, next); j.push(next, next + sides); k.push(here + sides, here + sides);
        }
      }
    }
    return {
      type: "mesh3d", x, y, z, i, j, k, color: colour, opacity: 0.45, group: "certainty",
      hovertemplate: name + ": one sigma, " + scene.magnification + " times<extra></extra>",
    };
  }

  function lines(points, colour, width, dash, group, text) {
    return {
      type: "scatter3d", mode: "lines", ...polylines(points), group,
      line: { color: colour, width, dash }, hovertemplate: text + "<extra></extra>",
    };
  }

  function traces() {
    const all = scene.boards.flatMap((board) => outline(board.corners));
    const found = [lines(all, "#7d8a92", 1.5, "solid", "boards", "board")];
    for (const sensor of scene.sensors) {
      if (sensor.before) {
        found.push(lines(sensor.before, "#4a545b", 3, "dot", "before", sensor.name + ", before"));
      }
      if (sensor.after) {
        found.push(lines(sensor.after, sensor.colour, 5, "solid", "after", sensor.name + ", after"));
      }
      if (sensor.ellipsoid) {
        found.push(ball(sensor.ellipsoid, sensor.colour, sensor.name));
      }
    }
    const placed = scene.sensors.filter((sensor) => sensor.place);
    found.push({
      type: "scatter3d", mode: "text", ...polylines(placed.map((sensor) => sensor.place)),
      text: placed.map((sensor) => sensor.name), textposition: "top center",
      textfont: { color: "#1b1f22", size: 13 }, group: "after", hoverinfo: "skip",
    });
    return found;
  }

  function ofCollection(key) {
    const found = [];
    for (const board of scene.boards.filter((one) => one.collection === key)) {
      found.push(lines(outline(board.corners), "#b25000", 5, "solid", "boards", "board of " + key));
    }
    for (const sensor of scene.sensors) {
      const text = (scene.points[key] || {})[sensor.name];
      if (text) {
        found.push({
          type: "scatter3d", mode: "markers", ...decoded(text), group: "points",
          marker: { size: 1.6, color: sensor.colour },
          hovertemplate: sensor.name + "<extra></extra>",
        });
      }
    }
    return found;
  }

  const eye = { turn: -60, rise: 22, distance: 1.75 };
  function camera() {
    const turn = (eye.turn * Math.PI) / 180, rise = (eye.rise * Math.PI) / 180;
    return {
      up: { x: 0, y: 0, z: 1 }, center: { x: 0, y: 0, z: -0.08 },
      eye: {
        x: eye.distance * Math.cos(rise) * Math.cos(turn),
        y: eye.distance * Math.cos(rise) * Math.sin(turn),
        z: eye.distance * Math.sin(rise),
      },
    };
  }

  function layout() {
    const spans = ranges.map((range) => range[1] - range[0]), longest = Math.max(...spans);
    const axis = (n) => ({
      range: ranges[n], title: { text: scene.axes[n] }, backgroundcolor: "#ffffff",
      gridcolor: "#dde3e6", zerolinecolor: "#c9d1d6", showspikes: false,
    });
    return {
      showlegend: false, margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: "#ffffff",
      scene: {
        xaxis: axis(0), yaxis: axis(1), zaxis: axis(2),
        aspectmode: "manual", dragmode: "turntable", camera: camera(),
        aspectratio: {
          x: (1.5 * spans[0]) / longest, y: (1.5 * spans[1]) / longest, z: (1.5 * spans[2]) / longest,
        },
      },
    };
  }

  const settings = { displayModeBar: false, displaylogo: false, responsive: true };
  const fixed = traces(), plan = layout();
  function draw() {
    const key = element("collection").value;
    const shown = (trace) => trace.group === "points" || element("show-" + trace.group).checked;
    const data = [...fixed, ...ofCollection(key)].filter(shown);
    plan.scene.camera = camera();
    return Plotly.react(viewer, data.map(({ group, ...trace }) => trace), plan, settings);
  }

  function seenFrom() {
    const now = viewer._fullLayout.scene._scene.getCamera().eye;
    eye.distance = Math.hypot(now.x, now.y, now.z);
    eye.turn = (Math.atan2(now.y, now.x) * 180) / Math.PI;
    eye.rise = (Math.asin(now.z / eye.distance) * 180) / Math.PI;
  }

  function drawsInThreeDimensions() {
    const canvas = document.createElement("canvas");
    return Boolean(canvas.getContext("webgl2") || canvas.getContext("webgl"));
  }

  if (!drawsInThreeDimensions()) {
    return;
  }
  viewer.hidden = element("controls").hidden = false;
  element("still").hidden = true;
  draw().then(() => {
    viewer.on("plotly_relayout", seenFrom);
    viewer.dataset.ready = "yes";
  });
  for (const name of ["collection", "show-before", "show-after", "show-boards", "show-certainty"]) {
    element(name).addEventListener("change", draw);
  }
  for (const button of document.querySelectorAll("[data-turn]")) {
    button.addEventListener("click", () => {
      const [turn, rise, nearer] = button.dataset.turn.split(" ").map(Number);
      eye.turn += turn;
      eye.rise = Math.max(-85, Math.min(85, eye.rise + rise));
      eye.distance = Math.max(0.2, Math.min(8, eye.distance * nearer));
      Plotly.relayout(viewer, { "scene.camera": camera() });
    });
  }
})();
