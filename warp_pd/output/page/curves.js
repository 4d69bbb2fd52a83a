// Curves of the history, with a line at the time that is shown.
(() => {
  "use strict";
  const { content, said } = window.page;
  const STROKES = ["#0b6e6e", "#c0392b", "#34568b", "#d8862b", "#6b4c9a", "#4d7c0f", "#8c564b", "#222"];

  class Curves {
    constructor(element, chosen, seek) {
      Object.assign(this, { element, seek, time: 0 });
      this.select = element.querySelector("select");
      content.history.graphs.forEach(({ label, unit }, k) => {
        this.select.add(new Option(unit ? `${label} (${unit})` : label, k));
      });
      this.select.value = chosen;
      this.select.onchange = () => this.build();
      new ResizeObserver(() => this.fit()).observe(element);
      this.build();
    }

    // Time, or the load factor of a static run.
    across() {
      const times = content.history.columns.time, full = content.loadDuration;
      return full ? times.map((time) => time / full) : times;
    }

    build() {
      const graph = content.history.graphs[this.select.value];
      const { columns } = content.history, seek = this.seek;
      const room = this.element.querySelector("div");
      room.textContent = "";
      const value = (plot, number) => (number === null || number === undefined ? "" : said(number));
      const axis = (label) => ({
        label, size: 34, labelSize: 18, labelGap: 0, labelFont: "12px system-ui", font: "11px system-ui", stroke: "#1d2429",
        grid: { stroke: "#e9edef" }, ticks: { stroke: "#b9c2c8", size: 5 },
        values: (plot, found) => found.map((number) => said(number)),
      });
      const name = content.loadDuration ? "load factor" : "time";
      const options = {
        width: this.element.clientWidth || 400, height: 176, cursor: { drag: { x: false, y: false } },
        scales: { x: { time: false } },
        axes: [axis(content.loadDuration ? name : "time (s)"), { ...axis(""), size: 60, label: undefined }],
        series: [{ label: name, value }].concat(graph.columns.map(({ label }, k) => (
          { label, value, stroke: STROKES[k % STROKES.length], width: 1.6, dash: k >= STROKES.length ? [6, 4] : undefined, points: { show: false } }
        ))),
        hooks: {
          draw: [(plot) => this.drawTime(plot)],
          ready: [(plot) => plot.over.addEventListener("click", () => {
            if (plot.cursor.left >= 0) seek(plot.posToVal(plot.cursor.left, "x") * (content.loadDuration || 1));
          })],
        },
      };
      const data = [this.across(), ...graph.columns.map(({ column }) => columns[column])];
      this.plot = new window.vendor.uPlot(options, data, room);
    }

    drawTime(plot) {
      const { ctx, bbox } = plot;
      const x = plot.valToPos(this.time / (content.loadDuration || 1), "x", true);
      if (x < bbox.left - 1 || x > bbox.left + bbox.width + 1) return;
      ctx.save();
      ctx.strokeStyle = "#1d2429";
      ctx.lineWidth = window.devicePixelRatio || 1;
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      ctx.restore();
    }

    show(time) {
      this.time = time;
      const times = content.history.columns.time;
      let nearest = 0;
      times.forEach((t, k) => { if (Math.abs(t - time) < Math.abs(times[nearest] - time)) nearest = k; });
      this.plot.setLegend({ idx: nearest });
      this.plot.redraw(false);
    }

    fit() {
      const width = this.element.clientWidth;
      if (this.plot && width && width !== this.plot.width) this.plot.setSize({ width, height: 176 });
    }
  }

  window.page.Curves = Curves;
})();
