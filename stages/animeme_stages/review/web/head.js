// The heads of a review page: loaded once, posed per picture. Bundled with three.js; see build.py.

import {
  AmbientLight,
  Box3,
  Color,
  DirectionalLight,
  HemisphereLight,
  LoadingManager,
  Mesh,
  MeshStandardMaterial,
  NeutralToneMapping,
  PerspectiveCamera,
  Scene,
  Vector3,
  WebGLRenderer,
} from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { MeshoptDecoder } from "meshoptimizer/decoder";
import { clone } from "three/examples/jsm/utils/SkeletonUtils.js";

/**
 * @typedef {{node: number, shapes: string[], rest: number[]}} MeshData
 * @typedef {{faces: number, meshes: MeshData[]}} AssetData
 * @typedef {{influences: number[], columns: number[], rest: number[]}} Driven
 * @typedef {{scene: import("three").Object3D, meshes: Map<number, Mesh[]>, face: Box3, mouth: Box3}} Model
 */

// Degrees from the front, to the character's left; degrees from above; part of the face in sight.
const LOOKS = /** @type {Record<string, [number, number, "face" | "mouth"]>} */ ({
  front: [0, 2, "face"],
  quarter: [38, 5, "face"],
  side: [88, 2, "face"],
  mouth: [14, 3, "mouth"],
});
const FOV_DEGREES = 24;
// Points that a shape moves by less than this share of its largest move do not belong to it.
const MOVED = 0.08;
// Points that speech moves by more than this share of its largest move are the mouth's.
const LIPS = 0.4;
const MOST_PIXEL_RATIO = 2;

/** All heads on one canvas: one renderer, one camera, shared geometry. */
class Stage {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this._canvas = canvas;
    this._renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this._renderer.toneMapping = NeutralToneMapping;
    this._camera = new PerspectiveCamera(FOV_DEGREES, 1, 0.01, 100);
    /** @type {Scene[]} */
    this._scenes = [];
    /** @type {Map<string, Promise<Model>>} */
    this._models = new Map();
    this._look = { azimuth: 0, elevation: 0, zoom: 1, part: /** @type {"face" | "mouth"} */ ("face") };
    /** @type {Model | null} */
    this._first = null;
    this._faces = 1;
    this._drawn = "";
    this._closed = false;
    this.look("front");
    this._listen();
  }

  /**
   * Another head, to the right of those that are there.
   *
   * @param {ArrayBuffer} glb
   * @param {string} digest - the same for the same `glb`, which is read once
   * @param {AssetData} asset
   * @param {string[]} names - of the curves that `set` is given
   */
  async add(glb, digest, asset, names) {
    const known = this._models.has(digest);
    if (!known) this._models.set(digest, load(glb, asset, names));
    const model = await /** @type {Promise<Model>} */ (this._models.get(digest));
    const used = this._scenes.some((scene) => scene.children.includes(model.scene));
    const shown = used ? copied(model) : model;
    const scene = lit();
    scene.add(shown.scene);
    this._scenes.push(scene);
    if (!this._first) {
      this._first = model;
      this._faces = asset.faces;
    }
    const driven = asset.meshes.flatMap((mesh) => drive(mesh, shown.meshes.get(mesh.node) ?? [], names));
    const posed = new Float64Array(names.length).fill(NaN);
    this._drawn = "";
    return {
      /** @param {ArrayLike<number>} weights */
      set: (weights) => {
        let moved = false;
        for (let column = 0; column < weights.length; column++) {
          const weight = /** @type {number} */ (weights[column]);
          moved ||= posed[column] !== weight;
          posed[column] = weight;
        }
        if (!moved) return;
        this._drawn = "";
        for (const { influences, columns, rest } of driven) {
          for (let target = 0; target < columns.length; target++) {
            const column = /** @type {number} */ (columns[target]);
            influences[target] = column < 0 ? /** @type {number} */ (rest[target]) : /** @type {number} */ (weights[column]);
          }
        }
      },
    };
  }

  clear() {
    this._scenes = [];
    this._first = null;
    this._drawn = "";
  }

  /** @param {string} from - a name in `LOOKS` */
  look(from) {
    const [azimuth, elevation, part] = LOOKS[from] ?? /** @type {[number, number, "face"]} */ ([0, 0, "face"]);
    const turned = Math.PI / 180;
    this._look = { azimuth: azimuth * turned, elevation: elevation * turned, zoom: 1, part };
    this._drawn = "";
  }

  /** Draw what has changed. */
  draw() {
    const { clientWidth: width, clientHeight: height } = this._canvas;
    if (!width || !height || !this._first || this._closed) return;
    const ratio = Math.min(devicePixelRatio || 1, MOST_PIXEL_RATIO);
    const state = `${width}x${height}@${ratio}`;
    if (state === this._drawn) return;
    this._drawn = state;
    const renderer = this._renderer;
    if (renderer.getPixelRatio() !== ratio) renderer.setPixelRatio(ratio);
    renderer.setSize(width, height, false);
    const part = width / this._scenes.length;
    this._aim(part / height);
    renderer.setScissorTest(true);
    this._scenes.forEach((scene, number) => {
      renderer.setViewport(part * number, 0, part, height);
      renderer.setScissor(part * number, 0, part, height);
      renderer.render(scene, this._camera);
    });
  }

  /** @param {number} aspect */
  _aim(aspect) {
    const { azimuth, elevation, zoom, part } = this._look;
    const box = /** @type {Model} */ (this._first)[part];
    const centre = box.getCenter(new Vector3());
    const size = box.getSize(new Vector3());
    const half = Math.tan((FOV_DEGREES * Math.PI) / 360);
    const reach = Math.max(size.y, Math.max(size.x, size.z) / aspect) / 2 / half / zoom + size.z / 2;
    const turn = azimuth + (this._faces < 0 ? Math.PI : 0);
    this._camera.position.set(Math.sin(turn) * Math.cos(elevation), Math.sin(elevation), Math.cos(turn) * Math.cos(elevation)).multiplyScalar(reach).add(centre);
    this._camera.aspect = aspect;
    this._camera.near = reach / 100;
    this._camera.far = reach * 100;
    this._camera.lookAt(centre);
    this._camera.updateProjectionMatrix();
  }

  /** Drag turns, the wheel and the arrow keys with Ctrl go nearer. */
  _listen() {
    /** @param {PointerEvent} event */
    const turn = (event) => {
      if (!event.buttons) return;
      this._turn(-event.movementX * 0.008, event.movementY * 0.006);
    };
    this._canvas.addEventListener("pointerdown", (event) => this._canvas.setPointerCapture(event.pointerId));
    this._canvas.addEventListener("pointermove", turn);
    this._canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this._look.zoom = Math.min(8, Math.max(0.3, this._look.zoom * Math.exp(-event.deltaY / 600)));
        this._drawn = "";
      },
      { passive: false },
    );
  }

  /** @param {number} azimuth @param {number} elevation */
  _turn(azimuth, elevation) {
    this._look.azimuth += azimuth;
    this._look.elevation = Math.min(1.4, Math.max(-1.4, this._look.elevation + elevation));
    this._drawn = "";
  }

  close() {
    this._closed = true;
    this._renderer.dispose();
    this._renderer.forceContextLoss();
  }
}

/** @returns {Scene} */
function lit() {
  const scene = new Scene();
  const key = new DirectionalLight(new Color(1, 0.97, 0.92), 1.7);
  key.position.set(1.2, 1.6, 2.2);
  const fill = new DirectionalLight(new Color(0.85, 0.92, 1), 0.7);
  fill.position.set(-2, 0.4, 1.2);
  const back = new DirectionalLight(new Color(0.85, 0.92, 1), 0.7);
  back.position.set(-0.6, 1, -2);
  scene.add(new HemisphereLight(0xffffff, 0xb0a498, 1.3), new AmbientLight(0xffffff, 0.35), key, fill, back);
  return scene;
}

/**
 * @param {ArrayBuffer} glb
 * @param {AssetData} asset
 * @param {string[]} names - of the curves that move it
 * @returns {Promise<Model>}
 */
async function load(glb, asset, names) {
  const loader = new GLTFLoader(new LoadingManager());
  loader.setMeshoptDecoder(MeshoptDecoder);
  const gltf = await loader.parseAsync(glb, "");
  const scene = gltf.scene;
  /** @type {Map<number, Mesh[]>} */
  const meshes = new Map();
  scene.updateMatrixWorld(true);
  scene.traverse((object) => {
    if (!(object instanceof Mesh)) return;
    object.frustumCulled = false; // shapes may leave the bounds of the rest
    const material = object.material;
    // Nothing is around that metal could mirror.
    if (material instanceof MeshStandardMaterial) material.metalness = Math.min(material.metalness, 0.2);
    if (!object.morphTargetInfluences) return;
    const node = nodeOf(gltf.parser.associations, object);
    if (node === undefined) return;
    object.userData["node"] = node;
    meshes.set(node, [...(meshes.get(node) ?? []), object]);
  });
  const spoken = new Map(asset.meshes.map((mesh) => [mesh.node, mesh.shapes.map((shape) => names.includes(shape))]));
  return { scene, meshes, ...framed(scene, meshes, spoken) };
}

/**
 * The glTF node that an object or what holds it came from.
 *
 * @param {Map<any, any>} associations
 * @param {import("three").Object3D} object
 * @returns {number | undefined}
 */
function nodeOf(associations, object) {
  for (let at = /** @type {import("three").Object3D | null} */ (object); at; at = at.parent) {
    const node = associations.get(at)?.nodes;
    if (node !== undefined) return node;
  }
  return undefined;
}

/** The same head once more; geometry and materials are shared. @param {Model} model @returns {Model} */
function copied(model) {
  const scene = clone(model.scene);
  /** @type {Map<number, Mesh[]>} */
  const meshes = new Map();
  scene.traverse((object) => {
    const node = object.userData["node"];
    if (object instanceof Mesh && node !== undefined) meshes.set(node, [...(meshes.get(node) ?? []), object]);
  });
  return { ...model, scene, meshes };
}

/**
 * What to look at: the face, and what of it moves most in speech.
 *
 * @param {import("three").Object3D} scene
 * @param {Map<number, Mesh[]>} meshes
 * @param {Map<number, boolean[]>} spoken - node → which of its targets speech moves
 */
function framed(scene, meshes, spoken) {
  const whole = new Box3().setFromObject(scene);
  const moved = new Box3();
  const mouth = new Box3();
  const point = new Vector3();
  for (const mesh of [...meshes.values()].flat()) {
    const targets = mesh.geometry.morphAttributes["position"] ?? [];
    const count = mesh.geometry.attributes["position"]?.count ?? 0;
    const sum = new Float32Array(count);
    const said = new Float32Array(count);
    targets.forEach((target, number) => {
      const counts = spoken.get(mesh.userData["node"])?.[number] ? 1 : 0;
      let most = 0;
      const length = new Float32Array(count);
      for (let at = 0; at < count; at++) {
        const far = Math.hypot(target.getX(at), target.getY(at), target.getZ(at));
        length[at] = far;
        most = Math.max(most, far);
      }
      for (let at = 0; most > 0 && at < count; at++) {
        const share = /** @type {number} */ (length[at]) / most;
        sum[at] = /** @type {number} */ (sum[at]) + share;
        said[at] = /** @type {number} */ (said[at]) + share * counts;
      }
    });
    const most = sum.reduce((a, b) => Math.max(a, b), 0);
    const mostSaid = said.reduce((a, b) => Math.max(a, b), 0);
    const step = Math.max(1, Math.floor(count / 4000));
    for (let at = 0; at < count; at += step) {
      const share = most > 0 ? /** @type {number} */ (sum[at]) / most : 0;
      if (share < MOVED) continue;
      mesh.getVertexPosition(at, point).applyMatrix4(mesh.matrixWorld);
      moved.expandByPoint(point);
      if (mostSaid > 0 && /** @type {number} */ (said[at]) > LIPS * mostSaid) mouth.expandByPoint(point);
    }
  }
  if (moved.isEmpty()) moved.copy(whole);
  if (mouth.isEmpty()) mouth.copy(moved);
  // A bust is shown whole; of a whole figure, the head.
  const face = moved.clone().expandByScalar(moved.getSize(point).length() * 0.2);
  const bust = whole.getSize(new Vector3()).length() < 1.7 * moved.getSize(new Vector3()).length();
  // Hair above the face is part of the picture.
  face.max.y = Math.max(face.max.y, Math.min(whole.max.y, face.max.y + 0.3 * face.getSize(point).y));
  return { face: (bust ? whole.clone() : face).expandByScalar(0.02), mouth: mouth.expandByScalar(mouth.getSize(point).length() * 0.1) };
}

/**
 * Which curve moves which target of some meshes.
 *
 * @param {MeshData} data
 * @param {Mesh[]} meshes - one for each primitive
 * @param {string[]} names
 * @returns {Driven[]}
 */
function drive(data, meshes, names) {
  const columns = data.shapes.map((shape) => names.indexOf(shape));
  return meshes.map((mesh) => ({ influences: mesh.morphTargetInfluences ?? [], columns, rest: data.rest }));
}

/** @type {any} */ (globalThis).animemeHead = {
  /** @param {HTMLCanvasElement} canvas */
  stage: (canvas) => new Stage(canvas),
};
