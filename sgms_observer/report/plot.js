// Draws each plot of the page with uPlot: panels over one time, the page's colours, zoom by drag, buttons and keys.
"use strict";
(() => {
  const numbers = (text) => {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    return Array.from(new Float32Array(bytes.buffer), (value) => (Number.isNaN(value) ? null : value));
  };
  const colour = (name) => () => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();

  function show(box) {
    const content = JSON.parse(box.querySelector("script").textContent);
    const time = numbers(content.time);
    const first = time[0], last = time[time.length - 1];
    const controls = document.createElement("div");
    const range = document.createElement("output");
    controls.className = "controls";
    box.before(controls);
    let charts = [];

    const zoom = (from, to) => {
      const width = Math.min(Math.max(to - from, (last - first) * 1e-4), last - first);
      const start = Math.min(Math.max(from, first), last - width);
      charts.forEach((chart) => chart.setScale("x", { min: start, max: start + width }));
    };
    const about = (factor, shift) => () => {
      const { min, max } = charts[0].scales.x;
      const half = (0.5 * (max - min)) / factor, middle = 0.5 * (min + max) + shift * (max - min);
      zoom(middle - half, middle + half);
    };
    const whole = () => zoom(first, last);
    const zoomed = (chart, key) => {
      if (key !== "x") return;
      const { min, max } = chart.scales.x;
      box.dataset.from = min;
      box.dataset.to = max;
      range.value = `${min.toPrecision(4)} s to ${max.toPrecision(4)} s`;
      charts.forEach((other) => {
        if (other.scales.x.min !== min || other.scales.x.max !== max) other.setScale("x", { min, max });
      });
    };

    const axis = (label, isTime) => ({
      label, stroke: colour("ink"), grid: { stroke: colour("line"), width: 1 }, ticks: { stroke: colour("line") },
      size: isTime ? 34 : 58, labelSize: 20, font: "12px sans-serif", labelFont: "12px sans-serif",
    });
    charts = content.panels.map((panel, number) => {
      const isLast = number === content.panels.length - 1;
      return new uPlot(
        {
          width: box.clientWidth, height: isLast ? 205 : 160,
          scales: { x: { time: false } },
          axes: [
            isLast ? axis("time [s]", true) : { ...axis(undefined, true), size: 8, values: (_, places) => places.map(() => "") },
            axis(panel.label, false),
          ],
          series: [
            { label: "time [s]" },
            ...panel.lines.map((line) => ({ label: line.label, stroke: colour(line.colour), width: 1.3 })),
          ],
          cursor: { sync: { key: content.time.slice(0, 32) + content.panels.length }, drag: { x: true, y: false } },
          hooks: { setScale: [zoomed] },
        },
        [time, ...panel.lines.map((line) => numbers(line.values))],
        box,
      );
    });

    const actions = [
      ["+", "zoom in", about(2, 0)], ["\u2212", "zoom out", about(0.5, 0)], ["\u2190", "earlier", about(1, -0.25)],
      ["\u2192", "later", about(1, 0.25)], ["whole", "show the whole", whole],
    ];
    for (const [sign, name, act] of actions) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = sign;
      button.title = name;
      button.setAttribute("aria-label", name);
      button.addEventListener("click", act);
      controls.append(button);
    }
    controls.append(range);
    const keys = { "+": 0, "=": 0, "-": 1, ArrowLeft: 2, ArrowRight: 3, 0: 4 };
    box.addEventListener("keydown", (event) => {
      if (!(event.key in keys) || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      actions[keys[event.key]][2]();
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => charts.forEach((c) => c.redraw(false, true)));
    new ResizeObserver(() => charts.forEach((c) => {
      if (box.clientWidth > 0 && c.width !== box.clientWidth) c.setSize({ width: box.clientWidth, height: c.height });
    })).observe(box);
    whole();
  }

  document.documentElement.classList.add("scripted");
  document.querySelectorAll(".plot").forEach(show);
})();
