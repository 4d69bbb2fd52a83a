// What the page holds: the content as JSON, and arrays that are unpacked when they are asked for.
window.page = window.page || {};

(() => {
  "use strict";
  const content = JSON.parse(document.getElementById("content").textContent);
  const kept = new Map();

  function bytesOf(text) {
    if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
    const read = atob(text), bytes = new Uint8Array(read.length);
    for (let k = 0; k < read.length; k++) bytes[k] = read.charCodeAt(k);
    return bytes;
  }

  // The bytes of an array; its text is dropped once it is read.
  async function inflated(number) {
    const element = document.getElementById(`array${number}`);
    const packed = bytesOf(element.textContent);
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
    element.remove();
    return bytes;
  }

  // Levels of a series, shape (frames, points): low bytes, then high bytes, of differences between frames.
  function levelsOf(bytes, frames, points) {
    const size = frames * points, levels = new Uint16Array(size);
    for (let k = 0; k < size; k++) {
      levels[k] = bytes[k] + 256 * bytes[k + size] + (k < points ? 0 : levels[k - points]);
    }
    return levels;
  }

  class Series {
    constructor(entry, levels) {
      Object.assign(this, { low: entry.low, high: entry.high, levels, points: entry.shape[1] });
      this.step = entry.span / 65534;
    }

    // Numbers of one frame into an array; NaN where there is none.
    read(frame, into, every = 1, first = 0) {
      const begin = frame * this.points;
      for (let k = 0, at = first; k < this.points; k++, at += every) {
        const level = this.levels[begin + k];
        into[at] = level === 0 ? NaN : this.low + (level - 1) * this.step;
      }
      return into;
    }
  }

  async function unpack(entry) {
    const bytes = await inflated(entry.text);
    if (entry.kind === "series") return new Series(entry, levelsOf(bytes, ...entry.shape));
    if (entry.kind === "bits") return bytes;
    return new (entry.kind === "float32" ? Float32Array : Uint32Array)(bytes.buffer);
  }

  function array(entry) {
    if (!kept.has(entry.text)) kept.set(entry.text, unpack(entry));
    return kept.get(entry.text);
  }

  // A choice of colour as a function (frame, numbers) that fills in the numbers of that frame, and its extremes.
  async function scalar(choice) {
    const parts = await Promise.all(content.fields[choice.field].map(array));
    if (choice.component !== -1) {
      const part = parts[choice.component || 0];
      return { fill: (frame, into) => part.read(frame, into), low: part.low, high: part.high };
    }
    const points = parts[0].points, rooms = parts.map(() => new Float32Array(points));
    const fill = (frame, into) => {
      parts.forEach((part, c) => part.read(frame, rooms[c]));
      for (let k = 0; k < points; k++) into[k] = Math.hypot(rooms[0][k], rooms[1][k], rooms[2][k]);
      return into;
    };
    let high = 0;
    const into = new Float32Array(points);
    for (let frame = 0; frame < content.frames.length; frame++) high = Math.max(high, extremes(fill(frame, into))[1]);
    return { fill, low: 0, high };
  }

  function extremes(numbers) {
    let low = Infinity, high = -Infinity;
    for (const number of numbers) {
      if (number < low) low = number;
      if (number > high) high = number;
    }
    return low <= high ? [low, high] : [0, 0];
  }

  // Round numbers between two, about as many as wanted.
  function ticks(low, high, wanted) {
    const span = high - low;
    if (!(span > 0)) return [low];
    const rough = span / wanted, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((s) => s * power >= rough * 0.999);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * span; k++) found.push(k * step);
    return found;
  }

  // A number in words, with no more digits than it takes.
  function said(number, digits = 4) {
    if (number === null || number === undefined || !Number.isFinite(number)) return "none";
    const text = Number(number).toPrecision(digits);
    const size = Math.abs(number);
    if (size !== 0 && (size < 1e-3 || size >= 1e5)) {
      const [mantissa, power] = Number(text).toExponential().split("e");
      return `${mantissa.replace("-", "\u2212")}\u00b710${raised(power)}`;
    }
    return String(Number(text)).replace("-", "\u2212");
  }

  function raised(power) {
    const signs = { "-": "\u207b", "+": "" };
    return [...power].map((c) => (c in signs ? signs[c] : "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079"[+c])).join("");
  }

  Object.assign(window.page, { content, array, scalar, extremes, ticks, said });
})();

// Colour maps of Matplotlib, 256 colours of six hexadecimal digits each: inferno, viridis and cividis (CC0), coolwarm
// (Moreland 2009).
window.page = window.page || {};
window.page.colourMaps = {
  inferno_r: "fcfea4fafda0f9fc9df7fb99f6fa95f5f891f4f78df3f689f2f485f2f381f1f27df1f079f1ee74f1ed70f1eb6cf1e968f1e864f2e660f2e45df3e259f3e056f3de52f4dc4ff4db4bf5d948f5d745f6d542f6d33ff7d13cf7cf3af8cd37f8cb34f8c931f9c72ff9c52cf9c32afac128fabf25fabd23fabb21fbb91efbb71cfbb51afbb318fbb116fbb014fbae12fbac10fbaa0efba80dfba60bfba40afba208fba007fb9e07fb9d06fb9b06fb9906fa9706fa9506fa9306fa9107f99008f98e08f98c09f88a0bf8880cf8870df7850ef78310f68111f68012f57e14f57c15f47a16f37918f37719f2751af2741cf1721df0701ef06f1fef6d21ee6c22ed6a23ed6825ec6726eb6527ea6428e9622ae8612be75f2ce65e2de65c2ee55b30e45a31e35832e25733e05634df5436de5337dd5238dc5039db4f3ada4e3bd94d3dd74b3ed64a3fd54940d44841d24742d14643d04544cf4446cd4247cc4148cb4049c93f4ac83e4bc73e4cc53d4dc43c4ec23b4fc13a50bf3951be3852bd3753bb3754ba3655b83556b73456b53357b43358b23259b1315aaf315bae305bac2f5cab2e5da92e5ea72d5fa62c5fa42c60a32b61a12b61a02a629e29639c29639b28649928649827659626669526669325679125679024688e24688d23698b226989226988216a86216a85206a83206b811f6b801f6b7e1e6c7d1d6c7b1d6c7a1c6d781c6d761b6d751b6d731a6d72196d70196e6e186e6d186e6b176e6a176e68166e66156e65156e63146e62146e60136e5f126e5d126e5b116e5a116d58106d570f6d550f6d530e6d520e6c500d6c4f0d6c4d0c6b4b0c6b4a0b6a480b6a460a69450a69430a684109674009663e09663c09653b096439096237096135096034095f32095d300a5c2e0a5a2d0a582b0a56290b54270b52260b50240b4e220b4c200c4a1f0c471d0c451c0c431a0b40190b3e170b3b160b39140b36130a34120a3210092f0f092d0e082a0d08280b07260a072309062108061f07051d06041b05041804031604031403021202021002010e01010b010109010007000006000004000003",
  viridis: "44015444025544035745055845065a45085b46095c460b5e460c5f460e61470f6247116347126547146647156747166947186a48196b481a6c481c6e481d6f481e70482071482172482273482374472575472676472777472878472a79472b7a472c7b462d7c462f7c46307d46317e45327f45347f453580453681443781443982433a83433b83433c84423d84423e854240854141864142864043874044873f45873f47883e48883e49893d4a893d4b893d4c893c4d8a3c4e8a3b508a3b518a3a528b3a538b39548b39558b38568b38578c37588c37598c365a8c365b8c355c8c355d8c345e8d345f8d33608d33618d32628d32638d31648d31658d31668d30678d30688d2f698d2f6a8d2e6b8e2e6c8e2e6d8e2d6e8e2d6f8e2c708e2c718e2c728e2b738e2b748e2a758e2a768e2a778e29788e29798e287a8e287a8e287b8e277c8e277d8e277e8e267f8e26808e26818e25828e25838d24848d24858d24868d23878d23888d23898d22898d228a8d228b8d218c8d218d8c218e8c208f8c20908c20918c1f928c1f938b1f948b1f958b1f968b1e978a1e988a1e998a1e998a1e9a891e9b891e9c891e9d881e9e881e9f881ea0871fa1871fa2861fa38620a48520a58521a68521a78422a78423a88323a98224aa8225ab8126ac8127ad8028ae7f29af7f2ab07e2bb17d2cb17d2eb27c2fb37b30b47a32b57a33b67935b77836b87738b97639b9763bba753dbb743ebc7340bd7242be7144be7045bf6f47c06e49c16d4bc26c4dc26b4fc36951c46853c56755c66657c66559c7645bc8625ec96160c96062ca5f64cb5d67cc5c69cc5b6bcd596dce5870ce5672cf5574d05477d05279d1517cd24f7ed24e81d34c83d34b86d44988d5478bd5468dd64490d64392d74195d73f97d83e9ad83c9dd93a9fd938a2da37a5da35a7db33aadb32addc30afdc2eb2dd2cb5dd2bb7dd29bade27bdde26bfdf24c2df22c5df21c7e01fcae01ecde01dcfe11cd2e11bd4e11ad7e219dae218dce218dfe318e1e318e4e318e7e419e9e419ece41aeee51bf1e51cf3e51ef6e61ff8e621fae622fde724",
  cividis: "00224d00234f00235000245200255400265500265700275900285b00285c00295e002a60002a62002b64002c66002c67002d69002e6b002f6d002f6f0030700030700031700031700432700833700b33700e347011356f14366f16366f18376f1a386f1c386e1d396e1f3a6e213b6e223b6e243c6e253d6d273d6d283e6d2a3f6d2b3f6d2c406d2e416c2f426c30426c31436c32446c34446c35456c36466c37466c38476c39486c3a486b3b496b3d4a6b3e4b6b3f4b6b404c6b414d6b424d6b434e6b444f6b454f6b46506b47516b48516b49526b4a536b4b546c4c546c4d556c4e566c4e566c4f576c50586c51586c52596c535a6c545a6c555b6d565c6d575d6d585d6d595e6d595f6d5a5f6d5b606e5c616e5d616e5e626e5f636e60646e61646f61656f62666f63666f64676f656870666970676970686a70686b71696b716a6c716b6d716c6d726d6e726e6f726e70736f70737071737172737273747373747474757475757575757676767777767878767978777979777a7a777b7b777c7b787d7c787e7d787f7d78807e78817f788280788380788481788582788583788683788784788885788986788a86788b87788c88788d89788e89788f8a77908b77918c77928c77938d77948e77958f77968f779790769891769992769a93769b93769c94769d95759e96759f9675a09775a19874a29974a39a74a49a74a59b73a69c73a79d73a89e73a99e72aa9f72aba072aca171ada271aea271afa370b0a470b1a570b2a66fb3a66fb4a76fb5a86eb6a96eb7aa6db8ab6db9ab6dbaac6cbbad6cbcae6bbdaf6bbeb06abfb06ac1b169c2b269c3b368c4b468c5b567c6b567c7b666c8b765c9b865cab964cbba64ccbb63cdbc62cebc62cfbd61d0be60d2bf60d3c05fd4c15ed5c25ed6c35dd7c35cd8c45bd9c55adac65adbc759dcc858dec957dfca56e0cb55e1cc54e2cc53e3cd52e4ce51e5cf50e6d04fe8d14ee9d24dead34cebd44becd54aedd648eed747efd846f1d944f2da43f3da42f4db40f5dc3ff6dd3df8de3bf9df3afae038fbe136fde234fde333fde534fde636fde737",
  coolwarm: "3a4cc03b4dc13c4fc33e51c43f53c64054c74156c94258ca435acc455bcd465dcf475fd04860d14962d34b64d44c66d64d67d74e69d8506bda516cdb526edc5370dd5571de5673e05775e15876e25a78e35b79e45c7be55d7de65f7ee76080e86182ea6383ea6485eb6586ec6788ed6889ee698bef6b8df06c8ef16d90f16f91f27093f37194f47395f47497f57598f6779af6789bf77a9df87b9ef87ca0f97ea1f97fa2fa80a4fa82a5fb83a6fb85a8fb86a9fc87aafc89acfc8aadfd8baefd8daffd8eb1fd90b2fe91b3fe92b4fe94b5fe95b7fe97b8fe98b9fe99bafe9bbbfe9cbcfe9dbdfe9fbefea0bffea2c0fea3c1fea4c2fea6c3fda7c4fda8c5fdaac6fdabc7fcacc8fcaec9fcafcafbb0cbfbb2cbfbb3ccfab4cdfab6cef9b7cff9b8cff8b9d0f8bbd1f7bcd1f6bdd2f6bed3f5c0d3f5c1d4f4c2d4f3c3d5f2c5d5f2c6d6f1c7d6f0c8d7efc9d7eecad8eeccd8edcdd9ecced9ebcfd9ead0dae9d1dae8d2dae7d3dbe6d5dbe5d6dbe4d7dbe2d8dbe1d9dce0dadcdfdbdcdedcdcdddddcdbdedbdadfdbd9e0dad7e1dad6e2d9d4e3d9d3e4d8d1e5d8d0e6d7cfe7d6cde7d6cce8d5cae9d4c9ead3c7ebd3c6ecd2c4ecd1c3edd0c1edcfc0eecfbeefcebcefcdbbf0ccb9f1cbb8f1cab6f2c9b5f2c8b3f2c7b2f3c6b0f3c5aff4c4adf4c3abf4c2aaf5c1a8f5c0a7f5bfa5f6bda4f6bca2f6bba0f6ba9ff6b99df6b79cf6b69af7b598f7b397f7b295f7b194f7b092f7ae91f7ad8ff6ab8df6aa8cf6a98af6a789f6a687f6a486f6a384f5a182f5a081f59e7ff49d7ef49b7cf49a7bf39879f39678f39576f29375f29173f19072f18e70f08d6ff08b6def896cee876aee8669ed8467ec8266ec8064eb7f63ea7d61ea7b60e9795ee8775de7755ce6745ae67259e57057e46e56e36c54e26a53e16852e06650df644fde624edd604cdc5e4bdb5c4ada5a48d95847d85646d75444d65243d44f42d34d40d24b3fd1493ecf463dce443ccd423acc3f39ca3d38c93b37c83835c63534c53233c43032c22d31c12a30bf282ebe232dbc1f2cbb1a2bb9162ab81129b60d28b50827b30326",
};

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
      float share = clamp((shown - low) / (high - low), 0.0, 1.0);
      vec3 colour = shown < -1e37 ? vec3(0.72) : texture2D(colours, vec2((255.0 * share + 0.5) / 256.0, 0.5)).rgb;
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
      const names = content.fields.displacement.map(array);
      const [reference, triangles, intact, ...moved] = await Promise.all(
        [content.reference, content.triangles, content.intact].map(array).concat(names),
      );
      const bodies = await Promise.all(content.bodies.map(bodyOf));
      return new SheetView(canvas, { reference, triangles, intact, moved, bodies });
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

    // Places that must be seen, in space: the sheet at some frames of the run, and where smaller bodies begin.
    places() {
      const last = content.frames.length - 1, found = [], grow = this.uniforms.grow.value;
      const room = new Float32Array(this.reference.length), every = Math.max(1, Math.ceil(this.points / 20000));
      for (const share of [0, 0.2, 0.4, 0.6, 0.8, 1]) {
        this.moved.forEach((part, c) => part.read(Math.round(share * last), room, 3, c));
        for (let k = 0; k < this.points; k += every) {
          const place = [0, 1, 2].map((c) => this.reference[3 * k + c] + grow * room[3 * k + c]);
          if (place.every(Number.isFinite)) found.push(place);
        }
      }
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

    look(view) {
      this.view = view;
      const { found, low, high, size } = this.places();
      this.flat = high[2] - low[2] < 1e-3 * size;
      const middle = new T.Vector3(...low.map((l, c) => 0.5 * (l + high[c])));
      const from = new T.Vector3(...VIEWS[view]).normalize();
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

// Controls, colour bar, tables; begins when everything else is there.
(() => {
  "use strict";
  const { content, scalar, extremes, ticks, said, colourMaps, SheetView, Curves, viewNames } = window.page;
  const { frames, summary, choices } = content;
  const SECONDS_OF_A_RUN = 8;
  const DAMAGE = "inferno_r", ONE_SIGN = "viridis", BOTH_SIGNS = "coolwarm";
  const MAP_WORDS = { inferno_r: "inferno", coolwarm: "cool and warm" };
  const get = (id) => document.getElementById(id);
  const state = { frame: 0, scalar: null, numbers: null, playing: null, graphs: [] };
  window.page.state = state;

  const unitOf = ({ unit }) => (unit ? ` (${unit})` : "");
  const choice = () => choices[get("field").value];

  function row(table, cells, head = false) {
    const line = table.insertRow();
    for (const [text, kind] of cells) {
      const cell = head ? line.appendChild(document.createElement("th")) : line.insertCell();
      cell.textContent = text;
      if (kind) cell.className = kind;
    }
    return line;
  }

  function plain(value) {
    if (typeof value === "number") return said(value, 6);
    return value === null ? "none" : typeof value === "object" ? JSON.stringify(value) : String(value);
  }

  function fillTables() {
    get("title").textContent = content.title.replaceAll("_", " ");
    document.title = content.title;
    const status = summary.status || "no summary";
    const facts = [summary.section, status, summary.material, summary.points && `${summary.points} points`,
      summary.date && summary.date.slice(0, 10), summary.version && `warp-pd ${summary.version}`];
    get("facts").textContent = facts.filter(Boolean).join("  \u00b7  ");
    fillMeasures(summary.measures || {});
    for (const note of [summary.message, ...(summary.notes || [])].filter(Boolean)) {
      get("notes").appendChild(document.createElement("p")).textContent = note;
    }
    for (const [name, value] of Object.entries(summary.settings || {})) {
      row(get("settings"), [[name.replaceAll("_", " ")], [plain(value), "number"]]);
    }
    const apart = ["scene", "section", "status", "message", "settings", "notes", "measures", "pictures", "energy"];
    for (const [name, value] of Object.entries(summary)) {
      if (!apart.includes(name)) row(get("about"), [[name.replaceAll("_", " ")], [plain(value)]]);
    }
    for (const id of ["settings", "about"]) get(id).parentElement.hidden = !get(id).rows.length;
    for (const line of content.leftOut) get("left-out").appendChild(document.createElement("li")).textContent = line;
  }

  function fillMeasures(measures) {
    const table = get("measures"), found = Object.entries(measures);
    table.previousElementSibling.hidden = !found.length;
    if (!found.length) return;
    const compared = found.some(([, { reference }]) => reference !== null);
    row(table.createTHead(), compared ? [[""], ["value", "number"], ["reference", "number"], ["error", "number"]] : [[""], ["value", "number"]], true);
    const body = table.createTBody();
    for (const [name, { value, unit, of, reference, source, error }] of found) {
      const units = unit === "1" || unit === "-" ? "" : ` ${unit}`;
      const cells = [[name.replaceAll("_", " ")], [value === null ? "none" : said(value, 5) + units, "number"]];
      if (compared && reference !== null) {
        cells.push([said(reference, 5) + units, "number"], [error === null ? "" : `${said(100 * error, 3)} %`, "number"]);
      } else if (compared) cells.push([""], [""]);
      const line = row(body, cells);
      const under = line.cells[0].appendChild(document.createElement("div"));
      under.className = "source";
      under.textContent = [of, reference !== null && source].filter(Boolean).join("; ");
    }
  }

  function drawBar(low, high) {
    const context = get("bar").querySelector("canvas").getContext("2d"), text = colourMaps[get("map").value];
    for (let k = 0; k < 256; k++) {
      context.fillStyle = `#${text.slice(6 * k, 6 * k + 6)}`;
      context.fillRect(0, 255 - k, 1, 1);
    }
    get("bar-title").textContent = choice().label + unitOf(choice());
    get("bar-ticks").textContent = "";
    for (const tick of ticks(low, high, 5)) {
      const mark = get("bar-ticks").appendChild(document.createElement("span"));
      mark.style.bottom = `${high > low ? (100 * (tick - low)) / (high - low) : 0}%`;
      mark.textContent = said(tick);
    }
  }

  // Limits of the colours; a signed field has zero in the middle of a map of two colours.
  function limits() {
    if (get("range").value === "own") return [Number(get("low").value), Number(get("high").value)];
    if (get("range").value === "frame") return balanced(...extremes(state.numbers));
    if (get("range").value === "most") return balanced(...mostOf(state.scalar));
    return choice().field === "damage" ? [0, 1] : balanced(state.scalar.low, state.scalar.high);
  }

  // Limits between which 98 % of the numbers of some frames are: a peak at the tip of a crack does not darken the rest.
  function mostOf(found) {
    if (!found.most) {
      const room = new Float32Array(state.view.points), every = Math.ceil(frames.length / 12), numbers = [];
      const apart = Math.ceil(room.length / 10000);
      for (let frame = frames.length - 1; frame >= 0; frame -= every) {
        found.fill(frame, room);
        for (let k = 0; k < room.length; k += apart) if (!Number.isNaN(room[k])) numbers.push(room[k]);
      }
      numbers.sort((a, b) => a - b);
      const at = (share) => numbers[Math.round(share * (numbers.length - 1))] ?? 0;
      found.most = [at(0.01), at(0.99)];
    }
    return found.most;
  }

  function balanced(low, high) {
    // Round-off is not shown as a limit.
    if (Math.abs(low) < 1e-9 * Math.abs(high)) low = 0;
    if (Math.abs(high) < 1e-9 * Math.abs(low)) high = 0;
    if (get("map").value !== BOTH_SIGNS) return [low, high];
    const most = Math.max(Math.abs(low), Math.abs(high));
    return [-most, most];
  }

  function colour() {
    state.scalar.fill(state.frame, state.numbers);
    const [low, high] = limits();
    if (get("range").value !== "own") [get("low").value, get("high").value] = [low, high].map((n) => Number(n.toPrecision(4)));
    state.view.paint(state.numbers, low, high);
    drawBar(low, high);
  }

  function show(frame) {
    state.frame = Math.max(0, Math.min(frames.length - 1, frame));
    get("frame").value = state.frame;
    get("frame-number").textContent = `${state.frame + 1} of ${frames.length}`;
    get("when").textContent = frames[state.frame].when;
    state.view.show(state.frame);
    colour();
    state.view.draw();
    for (const graph of state.graphs) graph.show(frames[state.frame].time);
    document.body.dataset.frame = state.frame;
    document.body.dataset.triangles = state.view.drawnTriangles;
  }

  async function chooseField() {
    const wanted = choice();
    const found = await scalar(wanted);
    if (wanted !== choice()) return;
    state.scalar = found;
    state.numbers = new Float32Array(state.view.points);
    const signed = found.low < -0.02 * Math.abs(found.high) && found.high > 0.02 * Math.abs(found.low);
    get("map").value = wanted.field === "damage" ? DAMAGE : signed ? BOTH_SIGNS : ONE_SIGN;
    get("range").value = "run";
    state.view.set("colours", get("map").value);
    show(state.frame);
    document.body.dataset.field = wanted.label;
  }

  function ownLimits() {
    const inputs = [get("low"), get("high")];
    const numbers = inputs.map(({ value }) => (value.trim() ? Number(value) : NaN));
    const right = numbers.every(Number.isFinite) && numbers[0] < numbers[1];
    inputs.forEach((input) => input.classList.toggle("wrong", !right));
    if (!right) return;
    get("range").value = "own";
    show(state.frame);
  }

  function play() {
    if (state.playing !== null) return pause();
    if (state.frame === frames.length - 1) show(0);
    let last = performance.now(), passed = 0;
    get("run").innerHTML = "&#10073;&#10073;";
    const step = (now) => {
      const seconds = Math.min(SECONDS_OF_A_RUN / frames.length, 0.5) / Number(get("speed").value);
      passed += (now - last) / 1000;
      last = now;
      const steps = Math.floor(passed / seconds);
      passed -= steps * seconds;
      if (steps) show(state.frame + steps);
      if (state.frame >= frames.length - 1) return pause();
      state.playing = requestAnimationFrame(step);
    };
    state.playing = requestAnimationFrame(step);
  }

  function pause() {
    cancelAnimationFrame(state.playing);
    state.playing = null;
    get("run").innerHTML = "&#9654;";
  }

  function seek(time) {
    if (!state.view) return;
    let nearest = 0;
    frames.forEach((frame, k) => { if (Math.abs(frame.time - time) < Math.abs(frames[nearest].time - time)) nearest = k; });
    pause();
    show(nearest);
  }

  // The picture with its bar, as a file.
  function save() {
    const source = get("canvas"), ratio = source.width / source.clientWidth;
    const copy = Object.assign(document.createElement("canvas"), { width: source.width, height: source.height });
    const context = copy.getContext("2d");
    context.fillStyle = "#fff";
    context.fillRect(0, 0, copy.width, copy.height);
    context.drawImage(source, 0, 0);
    context.scale(ratio, ratio);
    context.font = "14px system-ui, sans-serif";
    context.fillStyle = "#1d2429";
    const stage = get("stage").getBoundingClientRect();
    const at = (element) => {
      const box = element.getBoundingClientRect();
      return [box.left - stage.left, box.top - stage.top, box.width, box.height];
    };
    context.drawImage(get("bar").querySelector("canvas"), ...at(get("bar").querySelector("canvas")));
    context.textBaseline = "middle";
    for (const element of [get("when"), ...get("bar-ticks").children, get("scale").firstElementChild]) {
      const [x, y, , height] = at(element);
      context.fillText(element.textContent, x, y + 0.5 * height);
    }
    context.textAlign = "right";
    const [x, y, width] = at(get("bar-title"));
    context.fillText(get("bar-title").textContent, x + width, y + 8);
    context.fillRect(...at(get("scale").lastElementChild).map((n, k) => (k === 3 ? 2 : n)));
    const link = document.createElement("a");
    link.download = `${content.title}-${state.frame}.png`;
    link.href = copy.toDataURL("image/png");
    link.click();
  }

  function connect() {
    choices.forEach(({ label, unit }, k) => get("field").add(new Option(label + unitOf({ unit }), k)));
    Object.keys(colourMaps).forEach((name) => get("map").add(new Option(MAP_WORDS[name] || name, name)));
    const first = choices.findIndex(({ field }) => field === "damage");
    get("field").value = first < 0 ? 0 : first;
    get("frame").max = frames.length - 1;
    get("frame").oninput = () => { pause(); show(Number(get("frame").value)); };
    get("run").onclick = play;
    get("field").onchange = chooseField;
    get("map").onchange = () => { state.view.set("colours", get("map").value); show(state.frame); };
    get("range").onchange = () => show(state.frame);
    for (const id of ["low", "high"]) get(id).onchange = ownLimits;
    get("grow").onchange = () => { state.view.set("grow", Number(get("grow").value) || 0); state.view.look(state.view.view); };
    get("grid").onchange = () => state.view.set("grid", get("grid").checked ? state.view.cell : 0);
    get("shade").onchange = () => state.view.set("shade", get("shade").checked ? 1 : 0);
    get("with-bodies").hidden = !content.bodies.length;
    get("bodies").onchange = () => state.view.showBodies(get("bodies").checked);
    get("save").onclick = save;
    for (const name of viewNames) {
      const button = get("views").appendChild(document.createElement("button"));
      button.textContent = name;
      button.onclick = () => state.view.look(name);
    }
    document.addEventListener("keydown", (event) => {
      if (["INPUT", "SELECT", "BUTTON", "SUMMARY"].includes(event.target.tagName)) return;
      if (event.key === " ") { event.preventDefault(); play(); }
      if (event.key === "ArrowRight" || event.key === "ArrowLeft") { pause(); show(state.frame + (event.key === "ArrowRight" ? 1 : -1)); }
    });
  }

  function buildGraphs() {
    const rooms = [...document.querySelectorAll(".graph")], graphs = content.history.graphs;
    rooms.slice(graphs.length).forEach((room) => room.remove());
    const energies = Math.max(graphs.findIndex(({ label }) => label === "energies"), Math.min(1, graphs.length - 1));
    state.graphs = rooms.slice(0, graphs.length).map((room, k) => new Curves(room, k ? energies : 0, seek));
  }

  async function begin() {
    fillTables();
    buildGraphs();
    state.view = await SheetView.create(get("canvas"));
    connect();
    await chooseField();
    // A flat sheet that stays flat is seen from above, unless a body is above it.
    if (state.view.flat && !content.bodies.length) state.view.look("top");
    document.body.dataset.ready = "yes";
  }

  begin().catch((error) => {
    get("trouble").hidden = false;
    get("trouble").textContent = `The sheet cannot be drawn: ${error.message}`;
    console.error(error);
  });
})();
