// Surfaces, densities and skeletons as they come from the server, made into things of three.js.

import * as THREE from "three";
import { toCreasedNormals } from "three/addons/utils/BufferGeometryUtils.js";
import { hex } from "./colours";

/** Faces that meet at less than this are drawn as one, radians. */
const CREASE = 0.5;

/** Counts (u32), positions (f32), corners (u32). */
export function readMesh(buffer: ArrayBuffer): THREE.BufferGeometry {
    const [vertices, triangles] = new Uint32Array(buffer, 0, 2);
    const geometry = new THREE.BufferGeometry();
    const positions = new Float32Array(buffer, 8, 3 * vertices);
    geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    const corners = new Uint32Array(buffer, 8 + 12 * vertices, 3 * triangles);
    geometry.setIndex(new THREE.BufferAttribute(corners, 1));
    return enlarged(geometry, (large) => toCreasedNormals(large, CREASE));
}

/** Of a geometry in large units: three.js takes corners within a hundredth of a unit for one. */
function enlarged<T extends THREE.BufferGeometry>(
    geometry: THREE.BufferGeometry, make: (large: THREE.BufferGeometry) => T,
): T {
    geometry.computeBoundingSphere();
    const scale = 1e5 / (geometry.boundingSphere?.radius || 1);
    const made = make(geometry.clone().scale(scale, scale, scale));
    made.scale(1 / scale, 1 / scale, 1 / scale);
    return made;
}

export function edges(geometry: THREE.BufferGeometry): THREE.EdgesGeometry {
    const angle = THREE.MathUtils.radToDeg(CREASE);
    return enlarged(geometry, (large) => new THREE.EdgesGeometry(large, angle));
}

/** Red inside, blue outside, as in all pictures of densities; clear where there is nothing. */
function colours(most: number): (value: number) => [number, number, number, number] {
    const [inside, outside] = [hex("positive"), hex("negative")];
    return (value) => {
        const rgb = value > 0 ? inside : outside;
        const share = Math.min(1, Math.abs(value) / most) ** 0.6;
        return [rgb >> 16, (rgb >> 8) & 255, rgb & 255, Math.round(235 * share)];
    };
}

/**
 * A plane through a density: columns and rows (u32), a corner and both sides (three f32 each), then
 * the values (f32), rows of columns.
 */
export function readSlice(buffer: ArrayBuffer): THREE.Mesh {
    const [columns, rows] = new Uint32Array(buffer, 0, 2);
    const frame = new Float32Array(buffer, 8, 9);
    const values = new Float32Array(buffer, 44, columns * rows);
    const most = values.reduce((most, value) => Math.max(most, Math.abs(value)), 1e-12);
    const pixels = new Uint8Array(4 * columns * rows);
    const colour = colours(0.6 * most);
    values.forEach((value, i) => pixels.set(colour(value), 4 * i));
    const texture = new THREE.DataTexture(pixels, columns, rows);
    texture.colorSpace = THREE.SRGBColorSpace;
    texture.magFilter = texture.minFilter = THREE.LinearFilter;
    texture.needsUpdate = true;
    const [origin, across, up] = [0, 3, 6].map((i) => new THREE.Vector3().fromArray(frame, i));
    const corners = [origin, origin.clone().add(across), origin.clone().add(up),
        origin.clone().add(across).add(up)];
    const geometry = new THREE.BufferGeometry().setFromPoints(corners);
    geometry.setAttribute("uv",
        new THREE.BufferAttribute(new Float32Array([0, 0, 1, 0, 0, 1, 1, 1]), 2));
    geometry.setIndex([0, 1, 2, 1, 3, 2]);
    const material = new THREE.MeshBasicMaterial({
        map: texture, transparent: true, side: THREE.DoubleSide, depthWrite: false,
    });
    const mesh = new THREE.Mesh(geometry, material);
    mesh.renderOrder = 5;
    return mesh;
}

/** Points with values: x y z and the value, positive inside the part (four f32 each). */
export function readSkeleton(buffer: ArrayBuffer, size: number): THREE.Points {
    const numbers = new Float32Array(buffer);
    const count = numbers.length / 4;
    const [positions, colours] = [new Float32Array(3 * count), new Float32Array(3 * count)];
    const [inside, outside] = [new THREE.Color(hex("positive")), new THREE.Color(hex("negative"))];
    for (let i = 0; i < count; i += 1) {
        positions.set(numbers.subarray(4 * i, 4 * i + 3), 3 * i);
        (numbers[4 * i + 3] > 0 ? inside : outside).toArray(colours, 3 * i);
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
    return new THREE.Points(geometry, new THREE.PointsMaterial({ size, vertexColors: true }));
}
