// Mouse, touch and keys: where the person wants the part.

import * as THREE from "three";
import { TransformControls } from "three/addons/controls/TransformControls.js";
import type { Pose } from "./wire";
import type { View } from "./view";

/** Radians per pixel of a turning drag, and per second of a key. */
const TURN = { pixel: 0.008, second: 0.8 };

/** Share of the scene's size that a key moves in a second. */
const KEY_SPEED = 0.25;

const KEYS: Record<string, [number, number, number]> = {
    ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0],
    PageUp: [0, 0, -1], PageDown: [0, 0, 1],
};

export interface Wishes {
    /** The person wants the part here, and holds it. */
    hold(pose: Pose): void;
    letGo(): void;
}

/** The grip point and rotation that the person wants the part to have. */
export class Drag {
    private readonly target = new THREE.Object3D();
    private readonly gizmo: TransformControls;
    private readonly ray = new THREE.Raycaster();
    private readonly plane = new THREE.Plane();
    private readonly offset = new THREE.Vector3();
    private readonly keys = new Set<string>();
    private pointer?: number;
    private turning = false;
    private last = new THREE.Vector2();
    private before = performance.now();
    /** The hand holds the part: it goes where the target goes. */
    holds = false;
    enabled = false;

    constructor(private readonly view: View, private readonly wishes: Wishes) {
        const { canvas, camera, scene } = view;
        this.gizmo = new TransformControls(camera, canvas);
        this.gizmo.setSize(0.75);
        this.gizmo.addEventListener("dragging-changed", ({ value }) => {
            view.controls.enabled = !value;
            if (value) this.holds = true;
            else this.release();
        });
        scene.add(this.target, this.gizmo.getHelper());
        this.handles(false);
        // Before the controls that look around: a part that is taken hold of is not looked around.
        canvas.addEventListener("pointerdown", (e) => this.down(e), { capture: true });
        canvas.addEventListener("pointermove", (e) => this.move(e));
        for (const end of ["pointerup", "pointercancel"] as const) {
            canvas.addEventListener(end, (e) => this.up(e));
        }
        window.addEventListener("keydown", (e) => this.key(e, true));
        window.addEventListener("keyup", (e) => this.key(e, false));
        window.addEventListener("blur", () => this.keys.clear());
    }

    /** Shows the handles of a gizmo, or hides them. */
    handles(on: boolean): void {
        if (on) this.gizmo.attach(this.target);
        else this.gizmo.detach();
        this.gizmo.enabled = on;
    }

    letGo(): void {
        this.holds = false;
        this.wishes.letGo();
    }

    /** Once per frame: the target follows a hand that is free, or the hand the target. */
    step(): void {
        const now = performance.now();
        const seconds = Math.min(0.1, (now - this.before) / 1000);
        this.before = now;
        if (this.keys.size > 0 && this.enabled) this.byKeys(seconds);
        if (!this.holds) this.follow();
        else if (this.enabled) this.wishes.hold(this.pose());
    }

    private follow(): void {
        this.target.position.copy(this.view.handGrip());
        this.target.quaternion.copy(this.view.hand.quaternion);
    }

    private pose(): Pose {
        const turn = this.target.quaternion;
        const place = this.target.position.clone()
            .sub(this.view.grip.clone().applyQuaternion(turn));
        return [place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w];
    }

    private aim(event: PointerEvent): THREE.Ray {
        const box = this.view.canvas.getBoundingClientRect();
        const at = new THREE.Vector2(
            (event.clientX - box.left) / box.width * 2 - 1,
            1 - (event.clientY - box.top) / box.height * 2);
        this.ray.setFromCamera(at, this.view.camera);
        return this.ray.ray;
    }

    private hit(event: PointerEvent): THREE.Vector3 | undefined {
        this.aim(event);
        return this.ray.intersectObject(this.view.moving, false)[0]?.point;
    }

    private down(event: PointerEvent): void {
        this.view.canvas.focus();
        const busy = this.pointer !== undefined || (this.gizmo.enabled && this.gizmo.axis !== null);
        if (!this.enabled || busy || event.button !== 0) return;
        const hit = this.hit(event);
        if (!hit) return;
        event.stopImmediatePropagation();
        this.view.canvas.setPointerCapture(event.pointerId);
        this.view.canvas.classList.add("dragging");
        this.view.controls.enabled = false;
        if (!this.holds) this.follow();
        [this.pointer, this.turning, this.holds] = [event.pointerId, event.shiftKey, true];
        this.last.set(event.clientX, event.clientY);
        this.plane.setFromNormalAndCoplanarPoint(this.facing(), hit);
        this.offset.copy(this.target.position).sub(hit);
    }

    /** Drags are in a plane that holds the path, unless one looks along it. */
    private facing(): THREE.Vector3 {
        const facing = this.view.camera.getWorldDirection(new THREE.Vector3());
        const across = facing.clone().projectOnPlane(this.view.axis);
        return across.length() > 0.35 ? across.normalize() : facing;
    }

    private move(event: PointerEvent): void {
        if (this.pointer === undefined) {
            const over = this.enabled && event.pointerType === "mouse" && event.buttons === 0
                && this.hit(event) !== undefined;
            this.view.canvas.classList.toggle("over", over);
            return;
        }
        if (event.pointerId !== this.pointer) return;
        if (this.turning) {
            const [x, y] = [event.clientX - this.last.x, event.clientY - this.last.y];
            this.turn(TURN.pixel * x, TURN.pixel * y, 0);
        } else {
            const at = this.aim(event).intersectPlane(this.plane, new THREE.Vector3());
            if (at) this.target.position.copy(at).add(this.offset);
        }
        this.last.set(event.clientX, event.clientY);
    }

    private up(event: PointerEvent): void {
        if (event.pointerId !== this.pointer) return;
        this.pointer = undefined;
        this.view.canvas.classList.remove("dragging");
        this.view.controls.enabled = true;
        this.release();
    }

    /** The mouse lets go, and so does the hand: the part is free to follow the forces. */
    private release(): void {
        this.letGo();
    }

    private key(event: KeyboardEvent, down: boolean): void {
        if (!(event.key in KEYS)) return;
        // Sliders have keys of their own; a key that was pressed before is still let go.
        const elsewhere = event.target instanceof HTMLInputElement;
        if (!elsewhere) event.preventDefault();
        if (!down) this.keys.delete(event.key);
        else if (elsewhere) return;
        else if (this.enabled) {
            if (!this.holds) this.follow();
            this.keys.add(event.key);
            this.holds = true;
        }
        this.turning = event.shiftKey;
    }

    private byKeys(seconds: number): void {
        const sum = new THREE.Vector3();
        for (const key of this.keys) sum.add(new THREE.Vector3().fromArray(KEYS[key]));
        if (this.turning && this.pointer === undefined) {
            const turn = TURN.second * seconds;
            this.turn(sum.x * turn, -sum.y * turn, -sum.z * turn);
        } else {
            const step = sum.multiplyScalar(KEY_SPEED * this.view.size * seconds);
            this.target.position.add(step.applyQuaternion(this.view.camera.quaternion));
        }
    }

    /** Turns about the screen's vertical, horizontal and depth. */
    private turn(vertical: number, horizontal: number, depth: number): void {
        const axis = new THREE.Vector3(horizontal, vertical, depth);
        const angle = axis.length();
        if (angle === 0) return;
        axis.applyQuaternion(this.view.camera.quaternion).normalize();
        const turn = new THREE.Quaternion().setFromAxisAngle(axis, angle);
        this.target.quaternion.premultiply(turn).normalize();
    }

    /** Arrows of the gizmo, or its rings. */
    set mode(mode: "translate" | "rotate") {
        this.gizmo.setMode(mode);
    }
}
