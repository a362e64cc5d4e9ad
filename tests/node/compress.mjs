// Usage: node compress.mjs IN.glb OUT.glb meshopt|quantize|draco  Writes IN with a compressed mesh.
import { NodeIO, Primitive } from "@gltf-transform/core";
import {
  EXTMeshoptCompression,
  KHRDracoMeshCompression,
  KHRMeshQuantization,
} from "@gltf-transform/extensions";
import draco3d from "draco3dgltf";
import { MeshoptDecoder, MeshoptEncoder } from "meshoptimizer";

const [source, target, how] = process.argv.slice(2);
await MeshoptDecoder.ready;
await MeshoptEncoder.ready;
const io = new NodeIO()
  .registerExtensions([EXTMeshoptCompression, KHRDracoMeshCompression, KHRMeshQuantization])
  .registerDependencies({
    "meshopt.decoder": MeshoptDecoder,
    "meshopt.encoder": MeshoptEncoder,
    "draco3d.encoder": await draco3d.createEncoderModule(),
    "draco3d.decoder": await draco3d.createDecoderModule(),
  });
const document = await io.read(source);
if (how === "draco") {
  document.createExtension(KHRDracoMeshCompression).setRequired(true).setEncoderOptions({
    method: KHRDracoMeshCompression.EncoderMethod.SEQUENTIAL,
  });
} else {
  document.createExtension(KHRMeshQuantization).setRequired(true);
  for (const mesh of document.getRoot().listMeshes())
    for (const primitive of mesh.listPrimitives())
      for (const part of [primitive, ...primitive.listTargets()])
        for (const name of part.listSemantics()) {
          const accessor = part.getAttribute(name);
          const values = accessor.getArray();
          if (name !== "POSITION" || values.constructor !== Float32Array) continue;
          accessor.setArray(Int16Array.from(values, (value) => Math.round(value * 1000)));
        }
  if (how === "meshopt")
    document.createExtension(EXTMeshoptCompression).setRequired(true).setEncoderOptions({
      method: EXTMeshoptCompression.EncoderMethod.FILTER,
    });
}
await io.write(target, document);
process.stdout.write(JSON.stringify(document.getRoot().listExtensionsUsed().map((e) => e.extensionName)));
