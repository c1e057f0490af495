// Programs that decode one tile: each gives its vertices in degrees and metres, earth-centred ones, and triangles.

import { parse } from "@loaders.gl/core";
import { GLTFLoader, postProcessGLTF } from "@loaders.gl/gltf";
import { QuantizedMeshLoader } from "@loaders.gl/terrain";
import decode from "@here/quantized-mesh-decoder/src/index.js";
import { GLTFLoader as ThreeLoader } from "three/addons/loaders/GLTFLoader.js";
import { MeshoptDecoder } from "three/addons/libs/meshopt_decoder.module.js";
import { Vector3 } from "three";

import { placed, unplaced } from "./ground.mjs";
import { arrayOf, boundsOf } from "./sets.mjs";

const STEPS = 32767;
const GLTF = { core: { worker: false }, gltf: { loadImages: false } };

const threes = (flat) => Array.from({ length: flat.length / 3 }, (_, i) => [...flat.subarray(3 * i, 3 * i + 3)]);

// Numbers that have to be those of vertices.
const triangles = (indices, count) => {
  const found = threes(indices);
  if (!found.length || found.flat().some((index) => index >= count)) throw new Error("has corners that are no vertices");
  return found;
};

const HERE = {
  name: "@here/quantized-mesh-decoder",
  ending: "terrain",
  async read(bytes, tile) {
    const { header, vertexData, triangleIndices, extensions, ...sides } = decode(arrayOf(bytes));
    const count = vertexData.length / 3;
    const [west, south, east, north] = boundsOf(tile);
    const { minHeight, maxHeight } = header;
    const degrees = Array.from({ length: count }, (_, i) => {
      const [u, v, h] = [0, 1, 2].map((part) => vertexData[i + part * count] / STEPS);
      if (![u, v, h].every((part) => part >= 0 && part <= 1)) throw new Error("has a vertex outside of the tile");
      return [west + (east - west) * u, south + (north - south) * v, minHeight + (maxHeight - minHeight) * h];
    });
    const stops = Array.from({ length: count }, (_, i) => [vertexData[i], vertexData[i + count]]);
    // The sides that it lists are those that vertices are on.
    const lists = [sides.westIndices, sides.southIndices, sides.eastIndices, sides.northIndices];
    const ends = [[0, 0], [1, 0], [0, STEPS], [1, STEPS]];
    [ends[0], ends[1], ends[2], ends[3]].forEach(([axis, end], side) => {
      const on = stops.flatMap((stop, i) => (stop[axis] === end ? [i] : []));
      const listed = [...lists[side]].sort((a, b) => a - b);
      if (listed.join() !== on.join()) throw new Error("lists other vertices on a side than there are");
    });
    const found = triangles(triangleIndices, count);
    return { degrees, points: degrees.map(placed), stops, triangles: found, error: extensions.metadata.error };
  },
};

const LOADERS_TERRAIN = {
  name: "@loaders.gl/terrain",
  ending: "terrain",
  // In single precision it tells heights alone exactly, so places are taken from texture coordinates.
  async read(bytes, tile) {
    const mesh = await parse(arrayOf(bytes), QuantizedMeshLoader, { core: { worker: false } });
    const [west, south, east, north] = boundsOf(tile);
    const uv = mesh.attributes.TEXCOORD_0.value;
    const degrees = threes(mesh.attributes.POSITION.value).map(([, , height], i) => {
      return [west + (east - west) * uv[2 * i], south + (north - south) * uv[2 * i + 1], height];
    });
    const stops = degrees.map((_, i) => [uv[2 * i], uv[2 * i + 1]].map((part) => Math.round(part * STEPS)));
    return { degrees, points: degrees.map(placed), stops, triangles: triangles(mesh.indices.value, degrees.length) };
  },
};

// Of earth-centred points; at 180 degrees those of the tile's own side.
const globe = (tile, points, uv, found) => {
  const [west, , east] = boundsOf(tile);
  const near = (degrees) => degrees - 360 * Math.round((degrees - (west + east) / 2) / 360);
  const degrees = points.map(unplaced).map(([longitude, latitude, height]) => [near(longitude), latitude, height]);
  if (points.flat().some((value) => !Number.isFinite(value))) throw new Error("has a vertex that is nowhere");
  const stops = points.map((_, i) => [uv(i)[0], 1 - uv(i)[1]].map((part) => Math.round(part * STEPS)));
  return { degrees, points, stops, triangles: triangles(found, points.length) };
};

const LOADERS_GLTF = {
  name: "@loaders.gl/gltf",
  ending: "glb",
  async read(bytes, tile) {
    const gltf = postProcessGLTF(await parse(arrayOf(bytes), GLTFLoader, GLTF));
    const [node] = gltf.scene.nodes;
    const { attributes, indices } = node.mesh.primitives[0];
    const scaled = numbers(attributes.POSITION);
    const points = threes(scaled).map((at) => upright(moved(node, at)));
    const uv = numbers(attributes.TEXCOORD_0);
    return globe(tile, points, (i) => [uv[2 * i], uv[2 * i + 1]], indices.value);
  },
};

// The numbers of an accessor, which may stand for parts of the largest whole number.
const numbers = ({ value, normalized }) => {
  if (!normalized) return Float64Array.from(value);
  const most = { Int8Array: 127, Uint8Array: 255, Int16Array: 32767, Uint16Array: 65535 }[value.constructor.name];
  return Float64Array.from(value, (number) => Math.max(number / most, -1));
};

// A place of a node, by its matrix or its scale and translation, in glTF's axes.
const moved = ({ matrix, scale = [1, 1, 1], translation = [0, 0, 0] }, [x, y, z]) => {
  if (!matrix) return [x, y, z].map((value, axis) => value * scale[axis] + translation[axis]);
  return [0, 1, 2].map((row) => matrix[row] * x + matrix[4 + row] * y + matrix[8 + row] * z + matrix[12 + row]);
};

// From y up to z up.
const upright = ([x, y, z]) => [x, 0 - z, y];

// It takes matrices apart and puts them together again, which rounds; metres that all places are whole numbers of.
const FINEST = 2 ** -16;

const THREE = {
  name: "three",
  ending: "glb",
  async read(bytes, tile) {
    const { scene } = await new ThreeLoader().setMeshoptDecoder(MeshoptDecoder).parseAsync(arrayOf(bytes), "");
    scene.updateMatrixWorld(true);
    const meshes = [];
    scene.traverse((object) => object.isMesh && meshes.push(object));
    if (meshes.length !== 1) throw new Error(`has ${meshes.length} meshes`);
    const [{ geometry, matrixWorld }] = meshes;
    const { position, uv } = geometry.attributes;
    const points = Array.from({ length: position.count }, (_, i) => {
      const at = new Vector3().fromBufferAttribute(position, i).applyMatrix4(matrixWorld).toArray();
      return upright(at).map((value) => Math.round(value / FINEST) * FINEST);
    });
    return globe(tile, points, (i) => [uv.getX(i), uv.getY(i)], geometry.index.array);
  },
};

export const DECODERS = [HERE, LOADERS_TERRAIN, LOADERS_GLTF, THREE];
