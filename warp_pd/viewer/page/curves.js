// Curves of the history, with a line at the time that is shown, or with a dot if they are drawn against another column.
(() => {
  "use strict";
  const { content, said } = window.page;
  const STROKES = ["#0b6e6e", "#c0392b", "#34568b", "#d8862b", "#6b4c9a", "#4d7c0f", "#8c564b", "#222"];
  // What frames follow one another by: the page says so of a path whose load factor turns.
  const ALONG = content.along ?? (content.loadDuration ? "load factor" : "time (s)");

  class Curves {
    constructor(element, chosen, seek) {
      Object.assign(this, { element, seek, time: 0 });
      this.select = element.querySelector("select");
      content.history.graphs.forEach(({ label, unit }, k) => {
        this.select.add(new Option(unit ? `${label} (${unit})` : label, k));
      });
      this.select.value = chosen;
      this.against = document.createElement("select");
      this.against.setAttribute("aria-label", "Column along the horizontal axis");
      Object.keys(content.history.columns).filter((name) => name !== "step").forEach((name) => {
        this.against.add(new Option(`against ${name === "time" ? ALONG.replace(" (s)", "") : name.replaceAll("_", " ")}`, name));
      });
      this.select.after(this.against);
      for (const select of [this.select, this.against]) select.onchange = () => { this.build(); this.show(this.time); };
      new ResizeObserver(() => this.fit()).observe(element);
      this.build();
    }

    // Time, or the load factor of a static run, or another column.
    across() {
      if (!this.overTime()) return content.history.columns[this.against.value];
      const times = content.history.columns.time, full = content.loadDuration;
      return full ? times.map((time) => time / full) : times;
    }

    overTime() {
      return this.against.value === "time";
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
      const over = this.overTime(), across = this.across();
      const name = !over ? this.against.value.replaceAll("_", " ") : ALONG;
      const options = {
        width: this.element.clientWidth || 400, height: 176,
        // Against another column the legend keeps to the row that is shown.
        cursor: { drag: { x: false, y: false }, ...(over ? {} : { x: false, y: false, points: { show: false }, dataIdx: () => this.row() }) },
        scales: { x: { time: false } },
        axes: [axis(name), { ...axis(""), size: 60, label: undefined }],
        series: [{ label: name, value: (plot, number, series, row) => value(plot, (row ?? null) === null ? null : across[row]) }].concat(graph.columns.map(({ label }, k) => (
          { label, value, stroke: STROKES[k % STROKES.length], width: 1.6, dash: k >= STROKES.length ? [6, 4] : undefined, points: { show: false },
            ...(over ? {} : { paths: () => null }) }
        ))),
        hooks: {
          draw: [(plot) => (over ? this.drawTime(plot) : this.drawPath(plot, across))],
          ready: [(plot) => plot.over.addEventListener("click", (event) => {
            const { left, top } = plot.over.getBoundingClientRect();
            if (over) seek(plot.posToVal(event.clientX - left, "x") * (content.loadDuration || 1));
            else seek(columns.time[this.nearest(plot, across, event.clientX - left, event.clientY - top)]);
          })],
        },
      };
      // The plot wants rising numbers along its axis; a curve that goes back is drawn in drawPath.
      const rising = over ? across : across.filter((number) => number !== null).sort((a, b) => a - b);
      while (rising.length < across.length) rising.push(rising[rising.length - 1] ?? 0);
      const data = [rising, ...graph.columns.map(({ column }) => columns[column])];
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

    // The curves against another column in the order of time, and a dot at the row that is shown.
    drawPath(plot, across) {
      const { ctx, bbox } = plot, ratio = window.devicePixelRatio || 1, row = this.row();
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      ctx.clip();
      plot.data.slice(1).forEach((numbers, k) => {
        const at = (n) => [plot.valToPos(across[n], "x", true), plot.valToPos(numbers[n], "y", true)];
        const there = (n) => across[n] !== null && numbers[n] !== null && numbers[n] !== undefined;
        ctx.strokeStyle = ctx.fillStyle = STROKES[k % STROKES.length];
        ctx.lineWidth = 1.6 * ratio;
        ctx.beginPath();
        for (let n = 0, pen = false; n < numbers.length; n++) {
          if (there(n)) ctx[pen ? "lineTo" : "moveTo"](...at(n));
          pen = there(n);
        }
        ctx.stroke();
        if (!there(row)) return;
        ctx.beginPath();
        ctx.arc(...at(row), 4 * ratio, 0, 2 * Math.PI);
        ctx.fill();
      });
      ctx.restore();
    }

    // The row whose curves come nearest to a place of the plot.
    nearest(plot, across, left, top) {
      let best = 0, least = Infinity;
      for (const numbers of plot.data.slice(1)) {
        numbers.forEach((number, row) => {
          if (number === null || number === undefined || across[row] === null) return;
          const apart = Math.hypot(plot.valToPos(across[row], "x") - left, plot.valToPos(number, "y") - top);
          if (apart < least) [best, least] = [row, apart];
        });
      }
      return best;
    }

    // The row of the time that is shown.
    row() {
      const times = content.history.columns.time;
      let nearest = 0;
      times.forEach((t, k) => { if (Math.abs(t - this.time) < Math.abs(times[nearest] - this.time)) nearest = k; });
      return nearest;
    }

    show(time) {
      this.time = time;
      this.plot.setLegend({ idx: this.row() });
      this.plot.redraw(false);
    }

    fit() {
      const width = this.element.clientWidth;
      if (this.plot && width && width !== this.plot.width) this.plot.setSize({ width, height: 176 });
    }
  }

  window.page.Curves = Curves;
})();
