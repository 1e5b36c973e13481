// Both parts in space, the hand, the spring between them, and what the hand feels.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { type Colour, hex, onScheme } from "./colours";
import { edges, readMesh, readSkeleton, readSlice } from "./parts";
import type { Frame, Pose, Stage } from "./wire";
import { fixed } from "./words";

/** Points of the spring's line, and its turns. */
const SPRING = { points: 160, turns: 9 };

/** Layers that are loaded when they are switched on. */
export type Layer = "slice" | "skeleton";

/** Materials by the colour they have; they change with it. */
const painted: [THREE.MeshBasicMaterial | THREE.LineBasicMaterial | THREE.MeshStandardMaterial,
    Colour][] = [];

function paint<T extends (typeof painted)[0][0]>(material: T, colour: Colour): T {
    material.color.setHex(hex(colour));
    painted.push([material, colour]);
    return material;
}

/** Of all stages: what is not drawn any more is given back. */
const SHARED = {
    rim: paint(new THREE.LineBasicMaterial({ transparent: true, opacity: 0.55 }), "edge"),
    moving: paint(new THREE.MeshStandardMaterial({ roughness: 0.6 }), "moving"),
    movingRim: paint(new THREE.LineBasicMaterial(), "moving-edge"),
    hand: paint(new THREE.LineBasicMaterial(), "hand"),
};

export function put(object: THREE.Object3D, [x, y, z, qx, qy, qz, qw]: Pose): void {
    object.position.set(x, y, z);
    object.quaternion.set(qx, qy, qz, qw).normalize();
}

/** The bytes called by a name, if there is such a thing. */
export type Source = (name: string) => Promise<ArrayBuffer | undefined>;

export class View {
    readonly camera = new THREE.PerspectiveCamera(35, 1, 0.01, 100);
    readonly scene = new THREE.Scene();
    readonly controls: OrbitControls;
    /** The moving part's surface, for the mouse to take hold of. */
    moving = new THREE.Mesh();
    /** Where the part is, and where the hand would have it. */
    readonly part = new THREE.Group();
    readonly hand = new THREE.Group();
    /** Size of everything, metres. */
    size = 0.1;
    grip = new THREE.Vector3();
    /** The path. */
    axis = new THREE.Vector3(0, 0, -1);
    private readonly renderer: THREE.WebGLRenderer;
    private readonly fixed = new THREE.Group();
    private readonly fixedMaterial: THREE.MeshStandardMaterial;
    private readonly plane = new THREE.Plane(new THREE.Vector3(0, 1, 0), 0);
    private readonly force = arrow("force");
    private readonly torque = arrow("torque");
    private readonly spring: THREE.Line;
    private readonly labels: [HTMLElement, HTMLElement];
    private readonly bounds = new THREE.Box3();
    private layers: Record<Layer, THREE.Object3D[]> = { slice: [], skeleton: [] };
    private readonly loading = new Set<Layer>();
    private readonly shown = { slice: false, skeleton: false };
    private limits: [number, number] = [5, 0.3];
    private showsArrows = true;
    private stage = 0;
    private across = 1;
    private fixedCount = 0;
    private home = new THREE.Vector3();
    private drawn = performance.now();
    private slow = 0;
    private shape = "";
    /** Pixels by which the picture is moved to the right. */
    shift = 0;

    constructor(
        readonly canvas: HTMLCanvasElement, labels: HTMLElement, private readonly bytes: Source,
    ) {
        const antialias = !drawsByProcessor();
        this.renderer = new THREE.WebGLRenderer({ canvas, antialias, alpha: true });
        this.renderer.localClippingEnabled = true;
        this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
        this.camera.up.set(0, 0, 1);
        this.controls = new OrbitControls(this.camera, canvas);
        this.controls.enableDamping = true;
        this.controls.dampingFactor = 0.12;
        this.fixedMaterial = paint(new THREE.MeshStandardMaterial({
            roughness: 0.85, side: THREE.DoubleSide,
            transparent: true, opacity: 0.42, depthWrite: false,
            // Where both parts touch, the moving one is seen.
            polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2,
        }), "fixed");
        onScheme(() => {
            for (const [material, colour] of painted) material.color.setHex(hex(colour));
        });
        const points = new Float32Array(3 * SPRING.points);
        const geometry = new THREE.BufferGeometry();
        geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
        this.spring = new THREE.Line(geometry, SHARED.hand);
        this.spring.frustumCulled = false;
        const light = new THREE.DirectionalLight(0xffffff, 1.6);
        light.position.set(0.4, 0.7, 1);
        this.camera.add(light);
        this.scene.add(new THREE.HemisphereLight(0xffffff, 0xb8c4d0, 1.7), this.camera,
            this.fixed, this.part, this.hand, this.spring, this.force, this.torque);
        this.labels = ["force", "torque"].map((kind) => {
            const label = document.createElement("span");
            label.className = kind;
            return labels.appendChild(label);
        }) as [HTMLElement, HTMLElement];
        this.seeThrough(true);
    }

    /** Fetches the surfaces of a stage and looks at them. */
    async load(stage: Stage): Promise<void> {
        this.stage = stage.stage;
        this.quiet();
        this.loading.clear();
        this.layers = { slice: [], skeleton: [] };
        for (const group of [this.fixed, this.part, this.hand]) group.clear();
        this.limits = stage.limits ?? this.limits;
        this.grip.fromArray(stage.grip ?? [0, 0, 0]);
        this.axis.fromArray(stage.axis ?? [0, 0, -1]);
        this.across = stage.cut ?? 1;
        this.fixedCount = stage.fixed?.length ?? 0;
        const names = [...(stage.fixed ?? []).map((_, i) => `mesh/${i}`), "mesh/moving"];
        const meshes = await Promise.all(names.map(this.bytes));
        if (this.stage !== stage.stage) return;
        const moving = meshes.pop();
        for (const buffer of meshes) if (buffer) this.addFixed(readMesh(buffer));
        if (moving) this.addMoving(readMesh(moving));
        this.look(stage);
    }

    private addFixed(geometry: THREE.BufferGeometry): void {
        const mesh = new THREE.Mesh(geometry, this.fixedMaterial);
        mesh.renderOrder = 2;
        const rim = new THREE.LineSegments(edges(geometry), SHARED.rim);
        rim.material.clippingPlanes = this.fixedMaterial.clippingPlanes;
        this.fixed.add(mesh, rim);
    }

    private addMoving(geometry: THREE.BufferGeometry): void {
        this.moving = new THREE.Mesh(geometry, SHARED.moving);
        const rim = edges(geometry);
        this.part.add(this.moving, new THREE.LineSegments(rim, SHARED.movingRim));
        const ghost = new THREE.LineSegments(rim, SHARED.hand);
        ghost.renderOrder = 4;
        this.hand.add(ghost);
    }

    private look(stage: Stage): void {
        this.bounds.setFromObject(this.fixed);
        const all = this.bounds.clone();
        if (stage.seated && this.moving.geometry.attributes.position) {
            put(this.part, stage.seated);
            this.part.updateMatrixWorld(true);
            const seated = new THREE.Box3().setFromObject(this.part);
            const out = this.axis.clone().multiplyScalar(-1.35 * (stage.depth ?? 0));
            all.union(seated).union(seated.clone().translate(out));
        }
        if (all.isEmpty()) return;
        this.size = all.getSize(new THREE.Vector3()).length();
        this.camera.near = this.size / 50;
        this.camera.far = this.size * 30;
        const middle = all.getCenter(new THREE.Vector3());
        this.home.copy(this.fromTheSide(stage)).multiplyScalar(this.size * 1.95);
        this.controls.target.copy(middle);
        this.controls.minDistance = this.size / 6;
        this.controls.maxDistance = this.size * 8;
        this.goHome();
    }

    /** A direction from which the way from where the hand begins to the fit is seen from the side. */
    private fromTheSide(stage: Stage): THREE.Vector3 {
        const from = new THREE.Vector3().fromArray(stage.places?.at(-1)?.pose ?? [1, 0, 0]);
        const away = from.sub(new THREE.Vector3().fromArray(stage.seated ?? [0, 0, 0]))
            .projectOnPlane(this.axis).normalize();
        if (away.lengthSq() < 0.5) return new THREE.Vector3(0.47, -0.78, 0.4).normalize();
        const side = away.clone().cross(this.axis);
        // A view from below would be a strange one.
        if (side.z < -0.5) side.negate();
        const home = side.addScaledVector(away, 0.3).normalize();
        return home.addScaledVector(this.axis, -0.42).normalize();
    }

    /** Looks from where it began. */
    goHome(): void {
        this.camera.position.copy(this.controls.target).add(this.home);
        this.camera.updateProjectionMatrix();
        this.controls.update();
    }

    /** The spring's end at the hand. */
    handGrip(): THREE.Vector3 {
        return this.grip.clone().applyMatrix4(this.hand.matrixWorld);
    }

    /** Nothing is felt: neither arrows nor their numbers, nor a hand and its spring. */
    quiet(): void {
        for (const shown of [this.force, this.torque, this.spring, this.hand]) shown.visible = false;
        for (const label of this.labels) label.hidden = true;
    }

    show(frame: Frame): void {
        put(this.part, frame.object);
        put(this.hand, frame.hand);
        this.part.updateMatrixWorld();
        this.hand.updateMatrixWorld();
        const from = this.grip.clone().applyMatrix4(this.part.matrixWorld);
        const to = this.handGrip();
        this.coil(from, to);
        const apart = from.distanceTo(to) / this.size;
        this.hand.visible = apart > 0.004 || frame.doing > 0;
        const [force, torque] = [frame.force, frame.torque].map((v) =>
            new THREE.Vector3().fromArray(v));
        this.point(this.force, this.labels[0], to, force, this.limits[0],
            `${fixed(force.length(), 2)} N`);
        this.point(this.torque, this.labels[1], to, torque, this.limits[1],
            `${fixed(1e3 * torque.length(), 0)} mN·m`);
    }

    private coil(from: THREE.Vector3, to: THREE.Vector3): void {
        const along = to.clone().sub(from);
        const length = along.length();
        this.spring.visible = length > 0.006 * this.size;
        if (!this.spring.visible) return;
        const side = new THREE.Vector3(0.31, 0.73, 0.61).cross(along).normalize();
        const other = side.clone().cross(along).normalize();
        const radius = Math.min(0.016 * this.size, 0.3 * length);
        const positions = this.spring.geometry.attributes.position as THREE.BufferAttribute;
        for (let i = 0; i < SPRING.points; i += 1) {
            const share = i / (SPRING.points - 1);
            const turn = 2 * Math.PI * SPRING.turns * share;
            const width = radius * Math.min(1, 8 * Math.min(share, 1 - share));
            const at = from.clone().addScaledVector(along, share)
                .addScaledVector(side, width * Math.cos(turn))
                .addScaledVector(other, width * Math.sin(turn));
            positions.setXYZ(i, at.x, at.y, at.z);
        }
        positions.needsUpdate = true;
    }

    /** An arrow as long as its share of the limit, and its number at the tip. */
    private point(arrow: THREE.Group, label: HTMLElement, at: THREE.Vector3,
        vector: THREE.Vector3, limit: number, text: string): void {
        const share = vector.length() / Math.max(limit, 1e-9);
        arrow.visible = this.showsArrows && share > 0.015;
        label.hidden = !arrow.visible;
        if (!arrow.visible) return;
        const length = this.size * (0.06 + 0.34 * Math.min(1, share));
        arrow.position.copy(at);
        arrow.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0),
            vector.clone().normalize());
        arrow.scale.set(this.size, length, this.size);
        const tip = at.clone().addScaledVector(vector.clone().normalize(), length)
            .project(this.camera);
        const { clientWidth: width, clientHeight: height } = this.canvas;
        const [x, y] = [(tip.x + 1) / 2 * width + 8, (1 - tip.y) / 2 * height - 10];
        label.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
        label.textContent = text;
    }

    render(): void {
        this.ease();
        const { clientWidth: width, clientHeight: height } = this.canvas;
        const shape = `${width} ${height} ${this.shift} ${this.renderer.getPixelRatio()}`;
        if (shape !== this.shape) {
            this.shape = shape;
            this.renderer.setSize(width, height, false);
            this.camera.aspect = width / Math.max(1, height);
            this.camera.setViewOffset(width, height, -this.shift, 0, width, height);
            this.camera.updateProjectionMatrix();
        }
        this.controls.update();
        this.renderer.render(this.scene, this.camera);
    }

    /** Where pictures take long, they get coarser: a hand cannot wait. */
    private ease(): void {
        const now = performance.now();
        this.slow = 0.9 * this.slow + 0.1 * Math.min(500, now - this.drawn);
        this.drawn = now;
        const ratio = this.renderer.getPixelRatio();
        if (this.slow > 90 && ratio > 0.6) {
            this.renderer.setPixelRatio(Math.max(0.6, 0.75 * ratio));
            this.slow = 0;
        }
    }

    /** The picture as it is, PNG. */
    picture(): Promise<Blob | null> {
        this.render();
        return new Promise((done) => this.canvas.toBlob(done));
    }

    seeThrough(on: boolean): void {
        this.fixedMaterial.opacity = on ? 0.42 : 1;
        this.fixedMaterial.transparent = on;
        this.fixedMaterial.depthWrite = !on;
        this.fixedMaterial.needsUpdate = true;
    }

    /** Cuts the fixed parts open: what is nearer to the first view than a share of their size is gone. */
    cut(share: number | undefined): void {
        const planes = share === undefined ? null : [this.plane];
        const [min, max] = [this.bounds.min, this.bounds.max]
            .map((corner) => corner.getComponent(this.across));
        const away = this.home.getComponent(this.across) > 0 ? -1 : 1;
        this.plane.normal.set(0, 0, 0).setComponent(this.across, away);
        const at = away > 0 ? min + (share ?? 0) * (max - min) : max - (share ?? 0) * (max - min);
        this.plane.constant = -away * at;
        this.fixedMaterial.clippingPlanes = planes;
        for (const child of this.fixed.children) {
            const material = (child as THREE.Mesh).material as THREE.Material;
            material.clippingPlanes = planes;
            material.needsUpdate = true;
        }
    }

    arrows(on: boolean): void {
        this.showsArrows = on;
    }

    /** The moving part lets through what is inside it. */
    private fade(): void {
        const material = this.moving.material as THREE.MeshStandardMaterial;
        material.transparent = this.shown.slice || this.shown.skeleton;
        material.opacity = material.transparent ? 0.35 : 1;
        material.depthWrite = !material.transparent;
        material.needsUpdate = true;
    }

    /** Shows a layer, which is fetched the first time. */
    async layer(layer: Layer, on: boolean): Promise<void> {
        this.shown[layer] = on;
        this.fade();
        for (const object of this.layers[layer]) object.visible = on;
        const stage = this.stage;
        if (!on || this.loading.has(layer)) return;
        this.loading.add(layer);
        const names = [...Array(this.fixedCount).keys()].map(String).concat("moving");
        const found = await Promise.all(names.map((name) => this.bytes(`${layer}/${name}`)));
        if (this.stage !== stage) return;
        found.forEach((buffer, i) => {
            if (!buffer) return;
            const object = layer === "slice" ? readSlice(buffer)
                : readSkeleton(buffer, this.size / 110);
            (i === found.length - 1 ? this.part : this.fixed).add(object);
            this.layers[layer].push(object);
        });
    }
}

/** Whether there is no graphics card to draw with: then smooth edges cost too much. */
function drawsByProcessor(): boolean {
    const gl = document.createElement("canvas").getContext("webgl2");
    const info = gl?.getExtension("WEBGL_debug_renderer_info");
    if (!gl || !info) return false;
    const name = String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL));
    gl.getExtension("WEBGL_lose_context")?.loseContext();
    return /swiftshader|llvmpipe|software/i.test(name);
}

/** Along +y, of length 1 and width 1/size. */
function arrow(colour: Colour): THREE.Group {
    const group = new THREE.Group();
    const material = paint(new THREE.MeshBasicMaterial({ depthTest: false }), colour);
    material.transparent = true;
    const shaft = new THREE.Mesh(new THREE.CylinderGeometry(0.006, 0.006, 0.8, 12), material);
    shaft.position.y = 0.4;
    const head = new THREE.Mesh(new THREE.ConeGeometry(0.018, 0.22, 16), material);
    head.position.y = 0.89;
    group.add(shaft, head);
    for (const mesh of [shaft, head]) mesh.renderOrder = 10;
    group.visible = false;
    return group;
}
