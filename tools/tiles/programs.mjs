// Programs that take a whole set: each is given a folder and tells what is wrong with it.

import { createRequire } from "node:module";
import { readFileSync } from "node:fs";

import { load } from "@loaders.gl/core";
import { Tiles3DLoader } from "@loaders.gl/3d-tiles";
import validator from "gltf-validator";

import { boundsOf, bytesOf, served, tilesOf } from "./sets.mjs";

// Pixels along a side of a mask of water.
const PIXELS = 256;

const Cesium = createRequire(import.meta.url)("cesium");

// The Khronos validator, of every tile.
export const validated = async (folder) => {
  const faults = [];
  for (const { path, key } of tilesOf(folder)) {
    const report = await validator.validateBytes(new Uint8Array(bytesOf(path)), { format: "glb" });
    const { messages } = report.issues;
    faults.push(...messages.filter(({ severity }) => severity < 2).map(({ message }) => `${key}: ${message}`));
  }
  return faults;
};

// loaders.gl reads the tileset and all subtrees, and names the tiles that there are, and no others.
export const listed = (folder) =>
  served(folder, async (url) => {
    const options = { core: { worker: false }, "3d-tiles": { isTileset: true } };
    const { root } = await load(`${url}/tileset.json`, Tiles3DLoader, options);
    const there = new Set(tilesOf(folder).map(({ path }) => path.slice(folder.length + 1)));
    const named = new Set();
    for (const open = [root]; open.length; ) {
      const tile = open.pop();
      if (tile.contentUrl) named.add(tile.contentUrl.slice(url.length + 1));
      open.push(...tile.children);
    }
    const missing = [...there].filter((path) => !named.has(path)).map((path) => `${path} is not named`);
    return [...missing, ...[...named].filter((path) => !there.has(path)).map((path) => `${path} is not there`)];
  });

// CesiumJS creates meshes in workers of a browser; here it does so at once, by the same code.
const { Cesium3DTilesTerrainData } = Cesium;
if (Cesium3DTilesTerrainData) {
  Cesium3DTilesTerrainData.prototype.createMesh = Cesium3DTilesTerrainData.prototype._createMeshSync;
}

const provided = (folder, url) =>
  folder.endsWith("3dtiles")
    ? Cesium.Cesium3DTilesTerrainProvider.fromUrl(`${url}/tileset.json`, { requestVertexNormals: true })
    : Cesium.CesiumTerrainProvider.fromUrl(url, { requestVertexNormals: true });

// Degrees that places are asked for within the globe's ends: CesiumJS may find a place that lies on the very side of a
// tile in no triangle, by rounding, and tells 0 of it.
const WITHIN = 1e-9;

// Every tile as a provider of terrain of CesiumJS takes it, and the heights that it tells of places, by level.
export const cesium = (folder, places) =>
  served(folder, async (url) => {
    const provider = await provided(folder, url);
    const [faults, heights] = [[], new Map()];
    const tiles = tilesOf(folder);
    for (const { level, x, y, key } of tiles) {
      try {
        const row = 2 ** level - 1 - y;
        const data = await provider.requestTileGeometry(x, row, level);
        const { tilingScheme } = provider;
        const mesh = data._createMeshSync?.({ tilingScheme, x, y: row, level });
        if (folder.endsWith("3dtiles")) await mesh;
        if (provider.getTileDataAvailable(x, row, level) === false) throw new Error("is told not to be there");
        const tile = tilingScheme.tileXYToRectangle(x, row, level);
        const middle = Cesium.Rectangle.center(tile);
        const height = data.interpolateHeight(tile, middle.longitude, middle.latitude);
        if (!Number.isFinite(height)) throw new Error("has no height in its middle");
      } catch (error) {
        faults.push(`${key}: ${error.message ?? error}`);
      }
    }
    for (const level of new Set(tiles.map(({ level }) => level))) {
      const asked = places.map(([longitude, latitude]) => {
        const within = Math.min(Math.max(longitude, WITHIN - 180), 180 - WITHIN);
        return Cesium.Cartographic.fromDegrees(within, latitude);
      });
      await Cesium.sampleTerrain(provider, level, asked);
      heights.set(level, asked.map(({ height }) => height));
    }
    return { faults, heights, error: (level) => provider.getLevelMaximumGeometricError(level) };
  });

// The mask of water of every tile as CesiumJS takes it, held to what `isWater` says of the middles of pixels.
export const masked = (folder, isWater) =>
  served(folder, async (url) => {
    const provider = await Cesium.CesiumTerrainProvider.fromUrl(url, { requestWaterMask: true });
    const faults = provider.hasWaterMask ? [] : ["is told to have no mask of water"];
    let looked = 0;
    for (const tile of tilesOf(folder)) {
      const { level, x, y, key } = tile;
      const [west, , east, north] = boundsOf(tile);
      const step = (east - west) / PIXELS;
      const data = await provider.requestTileGeometry(x, 2 ** level - 1 - y, level);
      const mask = data.waterMask;
      const isOne = mask?.length === 1;
      if (!isOne && mask?.length !== PIXELS ** 2) {
        faults.push(`${key} has a mask of ${mask?.length} pixels`);
        continue;
      }
      for (let i = 0; i < PIXELS ** 2; i++) {
        const place = [west + ((i % PIXELS) + 0.5) * step, north - (Math.floor(i / PIXELS) + 0.5) * step];
        const expected = isWater(place);
        if (expected === undefined) continue;
        looked += 1;
        const found = mask[isOne ? 0 : i];
        if (found !== (expected ? 255 : 0)) {
          faults.push(`${key} has ${found} at ${place}`);
          break;
        }
      }
    }
    return { looked, faults };
  });

// 3d-tiles-renderer goes through the whole tree, and asks for every tile in it.
export const rendered = (folder) =>
  served(folder, async (url) => {
    globalThis.window = { location: { href: url } };
    globalThis.requestAnimationFrame = (call) => setTimeout(call, 0);
    globalThis.cancelAnimationFrame = clearTimeout;
    const warn = console.warn;
    console.warn = () => {};
    try {
      const { TilesRendererBase } = await import("3d-tiles-renderer/core");
      const { ImplicitTilingPlugin } = await import("3d-tiles-renderer/core/plugins");
      const [taken, faults] = [new Set(), []];
      class Renderer extends TilesRendererBase {
        calculateTileViewError(_, target) {
          Object.assign(target, { inView: true, error: Infinity, distance: 0 });
        }
        async parseTile(content, tile) {
          const { level, x, y } = tile.implicitTilingData;
          const half = /\/east\//.test(tile.content.uri) || tile.content.uri.startsWith("east");
          const magic = new TextDecoder().decode(content.slice(0, 4));
          if (magic !== "glTF") faults.push(`${tile.content.uri} begins with ${magic}`);
          taken.add(`${level}/${x + (half ? 2 ** level : 0)}/${y}`);
        }
      }
      const renderer = new Renderer(`${url}/tileset.json`);
      renderer.registerPlugin(new ImplicitTilingPlugin());
      const there = tilesOf(folder).map(({ key }) => key);
      for (let round = 0, calm = 0; calm < 10 && round < 4000; round++) {
        const before = taken.size;
        renderer.update();
        await new Promise((ready) => setTimeout(ready, 5));
        const { queued, downloading, parsing } = renderer.stats;
        calm = taken.size === before && !queued && !downloading && !parsing ? calm + 1 : 0;
      }
      if (renderer.stats.failed) faults.push(`${renderer.stats.failed} tiles are not got`);
      faults.push(...there.filter((key) => !taken.has(key)).map((key) => `${key} was not asked for`));
      renderer.dispose();
      return faults;
    } finally {
      console.warn = warn;
      delete globalThis.window;
    }
  });

export const versionOf = (name) =>
  JSON.parse(readFileSync(new URL(`node_modules/${name}/package.json`, import.meta.url))).version;
