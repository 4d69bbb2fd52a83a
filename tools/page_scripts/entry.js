// What the page of a run takes from its libraries; see build.sh.
export {
  AmbientLight, BufferAttribute, BufferGeometry, DataTexture, DirectionalLight, DoubleSide, FrontSide, Group,
  LinearFilter, Mesh, MeshLambertMaterial, OrthographicCamera, Points, RGBAFormat, Scene, ShaderMaterial,
  SphereGeometry, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
export { default as uPlot } from "uplot";
