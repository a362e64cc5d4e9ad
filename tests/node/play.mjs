// Usage: node play.mjs < requests.json  What three.js plays, as an independent judge.
//
// Each request: {character, clip, animation, times_s}; clip is the file that holds the animation and
// may be the character itself. Prints one JSON list: per request {node: [[weights] per time]}.
// A request with "avatar": true plays a .vrma by three-vrm: {expression: [weight per time]}.
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { AnimationMixer, LoopOnce, Texture } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { MeshoptDecoder } from "meshoptimizer";
import { VRMAnimationLoaderPlugin } from "@pixiv/three-vrm-animation";
import { dracoLoader } from "./draco.mjs";

globalThis.self ??= globalThis;
globalThis.ProgressEvent ??= class extends Event {};
console.warn = () => {};
const draco = dracoLoader();

// Pictures need a browser; weights do not need pictures.
const withoutTextures = () => ({ name: "none", loadTexture: async () => new Texture() });

async function load(file) {
  const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).setDRACOLoader(draco);
  loader.register(withoutTextures);
  loader.register((parser) => new VRMAnimationLoaderPlugin(parser));
  let data = readFileSync(file);
  if (data.subarray(0, 4).toString() !== "glTF") {
    const root = JSON.parse(data.toString());
    for (const buffer of root.buffers ?? [])
      if (!buffer.uri.startsWith("data:")) {
        const bytes = readFileSync(join(dirname(file), decodeURIComponent(buffer.uri)));
        buffer.uri = "data:application/octet-stream;base64," + bytes.toString("base64");
      }
    return loader.parseAsync(JSON.stringify(root), "");
  }
  return loader.parseAsync(new Uint8Array(data).buffer, "");
}

function played(gltf, clip, times) {
  const mixer = new AnimationMixer(gltf.scene);
  const action = mixer.clipAction(clip);
  action.setLoop(LoopOnce);
  action.clampWhenFinished = true;
  action.play();
  const weights = {};
  for (const time of times) {
    action.reset();
    mixer.setTime(time);
    gltf.scene.traverse((object) => {
      if (!object.morphTargetInfluences) return;
      let owner = object;
      while (gltf.parser.associations.get(owner)?.nodes === undefined) owner = owner.parent;
      const node = gltf.parser.associations.get(owner).nodes;
      const key = object === owner ? `${node}` : `${node}/${owner.children.indexOf(object)}`;
      (weights[key] ??= []).push([...object.morphTargetInfluences]);
    });
  }
  return weights;
}

function expressed(gltf, times) {
  const { preset, custom } = gltf.userData.vrmAnimations[0].expressionTracks;
  const weights = {};
  for (const [name, track] of [...preset, ...custom]) {
    const curve = track.createInterpolant();
    weights[name] = times.map((time) => curve.evaluate(time)[0]);
  }
  return weights;
}

const answers = [];
for (const { character, clip, animation, times_s, avatar } of JSON.parse(readFileSync(0))) {
  const source = await load(clip);
  if (avatar) {
    answers.push(expressed(source, times_s));
    continue;
  }
  const gltf = character === clip ? source : await load(character);
  const found = source.animations.find((candidate) => candidate.name === animation);
  answers.push(played(gltf, found, times_s));
}
process.stdout.write(JSON.stringify(answers));
