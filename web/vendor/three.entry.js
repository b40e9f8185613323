export {
  AmbientLight, BufferAttribute, BufferGeometry, CanvasTexture, Color, ConeGeometry, DirectionalLight, DoubleSide, DynamicDrawUsage,
  Float32BufferAttribute, Group, InstancedMesh, Line, LineBasicMaterial, LineSegments, Mesh, MeshBasicMaterial, MeshLambertMaterial,
  NearestFilter, Object3D, PerspectiveCamera, PlaneGeometry, BoxGeometry, Raycaster, RingGeometry, Scene, SphereGeometry, Sprite,
  SpriteMaterial, SRGBColorSpace, Vector2, Vector3, WebGLRenderer, Matrix4, Plane,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
