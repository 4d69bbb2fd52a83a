// The sheet and the bodies in space.
(() => {
  "use strict";
  const { content, array, said, colourMaps } = window.page;
  const T = window.vendor;
  const LIGHT = [0.35, 0.45, 0.82];
  const VIEWS = {
    "3D": [0.4415, -0.7647, 0.4695], top: [0, -1e-4, 1], front: [0, -1, 0], side: [1, 0, 0],
  };

  // Colours are those of the map, whatever way the sheet faces; lines of a grid painted on the sheet show its shape.
  const VERTEX = `
    attribute vec3 displacement;
    attribute float number;
    uniform float grow;
    varying float shown;
    varying vec3 painted, place;
    void main() {
      shown = number;
      painted = position;
      vec4 seen = modelViewMatrix * vec4(position + grow * displacement, 1.0);
      place = seen.xyz;
      gl_Position = projectionMatrix * seen;
      gl_PointSize = 5.0;
    }`;
  const FRAGMENT = `
    uniform sampler2D colours;
    uniform float low, high, grid, shade;
    uniform vec3 origin, light;
    varying float shown;
    varying vec3 painted, place;
    void main() {
      float fraction = clamp((shown - low) / (high - low), 0.0, 1.0);
      vec3 colour = shown < -1e37 ? vec3(0.72) : texture2D(colours, vec2((255.0 * fraction + 0.5) / 256.0, 0.5)).rgb;
      if (grid > 0.0) {
        vec3 cell = (painted - origin) / grid;
        vec3 wide = fwidth(cell);
        float line = 0.0;
        for (int c = 0; c < 3; c++) {
          if (wide[c] > 1e-5 && wide[c] < 0.4) {
            line = max(line, 1.0 - smoothstep(0.2, 0.9, abs(fract(cell[c] - 0.5) - 0.5) / wide[c]));
          }
        }
        float bright = dot(colour, vec3(0.299, 0.587, 0.114));
        colour = mix(colour, bright < 0.35 ? vec3(0.9) : vec3(0.1), 0.38 * line);
      }
      if (shade > 0.0) {
        vec3 normal = normalize(cross(dFdx(place), dFdy(place)));
        colour *= 0.5 + 0.5 * abs(dot(normal, light));
      }
      gl_FragColor = vec4(colour, 1.0);
    }`;

  function textureOf(name) {
    const text = colourMaps[name], bytes = new Uint8Array(1024);
    for (let k = 0; k < 256; k++) {
      for (let c = 0; c < 3; c++) bytes[4 * k + c] = parseInt(text.slice(6 * k + 2 * c, 6 * k + 2 * c + 2), 16);
      bytes[4 * k + 3] = 255;
    }
    const texture = new T.DataTexture(bytes, 256, 1, T.RGBAFormat);
    texture.magFilter = texture.minFilter = T.LinearFilter;
    texture.needsUpdate = true;
    return texture;
  }

  class SheetView {
    static async create(canvas) {
      const all = (entries) => Promise.all(entries.map(array));
      // Pages of the gallery may be older than these scripts, and have no framing.
      const once = [content.triangles, content.intact, ...(content.framing ? [content.framing.points] : [])];
      const [places, moved, [triangles, intact, framed]] = await Promise.all(
        [content.reference, content.fields.displacement, once].map(all),
      );
      const reference = new Float32Array(3 * places[0].points);
      places.forEach((part, c) => part.read(0, reference, 3, c));
      const bodies = await Promise.all(content.bodies.map(bodyOf));
      return new SheetView(canvas, { reference, triangles, intact, framed, moved, bodies });
    }

    constructor(canvas, parts) {
      Object.assign(this, parts, { canvas, frame: 0, scene: new T.Scene() });
      this.renderer = new T.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
      this.renderer.setPixelRatio(Math.max(window.devicePixelRatio || 1, 1));
      this.points = this.reference.length / 3;
      this.addSheet();
      this.addBodies();
      this.camera = new T.OrthographicCamera();
      this.camera.up.set(0, 0, 1);
      this.controls = new T.OrbitControls(this.camera, canvas);
      this.controls.addEventListener("change", () => this.draw());
      this.look("3D");
      new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    }

    addSheet() {
      const attribute = (array, size) => new T.BufferAttribute(array, size);
      const geometry = new T.BufferGeometry();
      this.displacement = new Float32Array(this.reference.length);
      this.numbers = new Float32Array(this.points);
      this.index = new Uint32Array(this.triangles.length);
      geometry.setAttribute("position", attribute(this.reference, 3));
      geometry.setAttribute("displacement", attribute(this.displacement, 3));
      geometry.setAttribute("number", attribute(this.numbers, 1));
      geometry.setIndex(attribute(this.index, 1));
      this.box = boxOf(this.reference);
      const size = Math.max(...this.box.high.map((high, c) => high - this.box.low[c])) || 1;
      this.cell = size / 20;
      this.uniforms = Object.fromEntries(Object.entries({
        grow: 1, low: 0, high: 1, grid: this.cell, shade: 0, colours: textureOf("inferno_r"),
        origin: new T.Vector3(...this.box.low), light: new T.Vector3(...LIGHT).normalize(),
      }).map(([name, value]) => [name, { value }]));
      const material = new T.ShaderMaterial({
        vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms: this.uniforms, side: T.DoubleSide,
      });
      // A row of points has no triangles.
      if (!this.triangles.length) geometry.setIndex(null);
      this.mesh = this.triangles.length ? new T.Mesh(geometry, material) : new T.Points(geometry, material);
      this.mesh.frustumCulled = false;
      this.scene.add(this.mesh);
    }

    addBodies() {
      this.group = new T.Group();
      const sun = new T.DirectionalLight(0xffffff, 2.2);
      sun.position.set(-0.4, -0.5, 0.77);
      this.scene.add(new T.AmbientLight(0xffffff, 1.4), sun, this.group);
      for (const body of this.bodies) {
        // A plane is large, and seen from both sides.
        const plane = body.kind === "plane";
        const material = new T.MeshLambertMaterial({
          color: 0x4f81b0, transparent: true, opacity: plane ? 0.2 : 0.5, depthWrite: false,
          side: plane ? T.DoubleSide : T.FrontSide,
        });
        body.mesh = new T.Mesh(body.geometry, material);
        this.group.add(body.mesh);
      }
    }

    // Colours: numbers of the points at this frame, and between which limits.
    paint(numbers, low, high) {
      for (let k = 0; k < this.points; k++) this.numbers[k] = Number.isNaN(numbers[k]) ? -3e38 : numbers[k];
      this.mesh.geometry.attributes.number.needsUpdate = true;
      this.uniforms.low.value = low;
      this.uniforms.high.value = high > low ? high : low + 1;
    }

    show(frame) {
      this.frame = frame;
      this.moved.forEach((part, c) => part.read(frame, this.displacement, 3, c));
      this.mesh.geometry.attributes.displacement.needsUpdate = true;
      const count = this.triangles.length / 3, row = frame * Math.ceil(count / 8);
      let drawn = 0;
      for (let t = 0; t < count; t++) {
        if ((this.intact[row + (t >> 3)] >> (t & 7)) & 1) {
          for (let c = 0; c < 3; c++) this.index[drawn++] = this.triangles[3 * t + c];
        }
      }
      if (this.mesh.geometry.index) {
        this.mesh.geometry.index.needsUpdate = true;
        this.mesh.geometry.setDrawRange(0, drawn);
      }
      this.drawnTriangles = drawn / 3;
      for (const { mesh, poses } of this.bodies) {
        mesh.position.set(...poses[frame].slice(0, 3));
        mesh.quaternion.set(...poses[frame].slice(3));
      }
    }

    set(name, value) {
      this.uniforms[name].value = name === "colours" ? textureOf(value) : value;
      this.draw();
    }

    showBodies(visible) {
      this.group.visible = visible;
      this.draw();
    }

    // Places that must be seen, in space: what is held of the sheet at some frames of the run, and where smaller bodies begin; or the
    // drawn part of the sheet at the frame that is shown.
    places() {
      const found = [], grow = this.uniforms.grow.value;
      if (this.fitted) {
        const drawn = this.mesh.geometry.index ? new Set(this.index.subarray(0, 3 * this.drawnTriangles)) : this.numbers.keys();
        for (const k of drawn) {
          const place = [0, 1, 2].map((c) => this.reference[3 * k + c] + grow * this.displacement[3 * k + c]);
          if (place.every(Number.isFinite)) found.push(place);
        }
        if (found.length) {
          const { low, high } = boxOf(found.flat());
          return { found, low, high, size: Math.max(...high.map((h, c) => h - low[c])) || 1 };
        }
      }
      const room = new Float32Array(this.reference.length), every = Math.max(1, Math.ceil(this.points / 20000));
      const bytes = Math.ceil(this.points / 8), last = content.frames.length - 1;
      const frames = this.framed ? content.framing.frames : [0, 0.2, 0.4, 0.6, 0.8, 1].map((part) => Math.round(part * last));
      frames.forEach((frame, row) => {
        this.moved.forEach((part, c) => part.read(frame, room, 3, c));
        for (let k = 0; k < this.points; k += every) {
          if (this.framed && !((this.framed[row * bytes + (k >> 3)] >> (k & 7)) & 1)) continue;
          const place = [0, 1, 2].map((c) => this.reference[3 * k + c] + grow * room[3 * k + c]);
          if (place.every(Number.isFinite)) found.push(place);
        }
      });
      const { low, high } = boxOf(found.flat());
      const size = Math.max(...high.map((h, c) => h - low[c])) || 1;
      for (const { radius, poses } of this.bodies) {
        if (2 * radius > size) continue;
        for (const sign of [-1, 1]) for (let c = 0; c < 3; c++) {
          found.push(poses[0].slice(0, 3).map((x, d) => {
            const place = x + (c === d ? sign * radius : 0);
            return Math.min(Math.max(place, low[d] - 0.5 * size), high[d] + 0.5 * size);
          }));
        }
      }
      return { found, low, high, size };
    }

    look(view, fitted = false) {
      this.view = view;
      this.fitted = fitted;
      const { found, low, high, size } = this.places();
      this.flat = high[2] - low[2] < 1e-3 * size;
      const middle = new T.Vector3(...low.map((l, c) => 0.5 * (l + high[c])));
      const from = new T.Vector3(...VIEWS[view]).normalize();
      if (fitted) from.copy(this.camera.position).sub(this.controls.target).normalize();
      this.camera.position.copy(middle).addScaledVector(from, 4 * size);
      this.camera.near = 0.01 * size;
      this.camera.far = 60 * size;
      this.camera.lookAt(middle);
      const inverse = this.camera.quaternion.clone().invert(), place = new T.Vector3();
      const seen = boxOf(found.map((at) => place.set(...at).sub(middle).applyQuaternion(inverse).toArray()).flat());
      // The middle of what is seen goes to the middle of the picture.
      const shift = new T.Vector3(0.5 * (seen.low[0] + seen.high[0]), 0.5 * (seen.low[1] + seen.high[1]), 0);
      shift.applyQuaternion(this.camera.quaternion);
      this.camera.position.add(shift);
      this.controls.target.copy(middle.add(shift));
      this.half = [0, 1].map((c) => 0.5 * (seen.high[c] - seen.low[c]));
      this.resize();
    }

    resize() {
      const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
      if (!width || !height) return;
      this.renderer.setSize(width, height, false);
      // Room for the colour bar on the right; the sheet is in the middle of what is left.
      const bar = Math.min(130, 0.25 * width), free = width - bar;
      // Above is the time, below are the axes and the scale.
      this.unit = Math.max((2 * this.half[0]) / (free - 40), (2 * this.half[1]) / (height - 110)) || 1e-9;
      const across = 0.5 * this.unit * width, up = 0.5 * this.unit * height, aside = 0.5 * this.unit * bar;
      const down = 20 * this.unit;
      Object.assign(this.camera, { left: -across + aside, right: across + aside, bottom: -up - down, top: up - down });
      this.camera.zoom = 1;
      this.camera.updateProjectionMatrix();
      this.controls.update();
      this.draw();
    }

    draw() {
      this.renderer.render(this.scene, this.camera);
      this.drawAxes();
      this.drawScale();
    }

    drawAxes() {
      const inverse = this.camera.quaternion.clone().invert();
      const axes = ["x", "y", "z"].map((name, c) => {
        const tip = new T.Vector3().setComponent(c, 1).applyQuaternion(inverse);
        return Math.hypot(tip.x, tip.y) < 0.05 ? "" :
          `<line x2="${24 * tip.x}" y2="${-24 * tip.y}"/><text x="${33 * tip.x}" y="${-33 * tip.y}">${name}</text>`;
      });
      document.getElementById("axes").innerHTML = axes.join("");
    }

    drawScale() {
      const size = (140 * this.unit) / this.camera.zoom, length = roundBelow(size);
      const bar = document.getElementById("scale");
      bar.querySelector("i").style.width = `${(length / size) * 140}px`;
      bar.querySelector("span").textContent = `${said(length)} m`;
    }
  }

  async function bodyOf(body) {
    if (body.radius) return { ...body, geometry: new T.SphereGeometry(body.radius, 64, 32) };
    const [vertices, triangles] = await Promise.all([array(body.vertices), array(body.triangles)]);
    const geometry = new T.BufferGeometry();
    geometry.setAttribute("position", new T.BufferAttribute(vertices, 3));
    geometry.setIndex(new T.BufferAttribute(triangles, 1));
    // Each triangle has a normal of its own: edges of a box stay sharp.
    const flat = geometry.toNonIndexed();
    flat.computeVertexNormals();
    flat.computeBoundingSphere();
    return { ...body, radius: flat.boundingSphere.radius, geometry: flat };
  }

  // The largest of 1, 2, 5, 10, ... that is not above a size.
  function roundBelow(size) {
    const power = 10 ** Math.floor(Math.log10(size));
    return power * [5, 2, 1].find((step) => step * power <= size * 1.0001);
  }

  function boxOf(points) {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (let k = 0; k < points.length; k++) {
      low[k % 3] = Math.min(low[k % 3], points[k]);
      high[k % 3] = Math.max(high[k % 3], points[k]);
    }
    return { low, high };
  }

  Object.assign(window.page, { SheetView, viewNames: Object.keys(VIEWS) });
})();
