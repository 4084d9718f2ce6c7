// The worker that draws the robot in space by WebGL 2 on the page's canvas. It is told geometry,
// ground, colours, size, camera and poses, and tells the number of each pose that it has drawn: the
// page sends the next one then. Drawing here never keeps the page from its heartbeat.
import { looking, moved, multiply, perspective } from "./matrix.js";
import { solids } from "./solids.js";

const VERTEX = `#version 300 es
in vec3 place; in vec3 normal;
uniform mat4 world, seen;
out vec3 facing; out vec2 ground;
void main() {
  vec4 at = world * vec4(place, 1.0);
  facing = mat3(world) * normal; ground = at.xy;
  gl_Position = seen * at;
}`;
const FRAGMENT = `#version 300 es
precision highp float;
in vec3 facing; in vec2 ground;
uniform vec3 colour, line; uniform bool gridded, plain;
out vec4 shown;
float lines(float every) {
  vec2 cell = ground / every, width = fwidth(cell);
  vec2 near = abs(fract(cell - 0.5) - 0.5) / max(width, vec2(1e-6));
  return (1.0 - min(min(near.x, near.y), 1.0)) * (1.0 - smoothstep(0.15, 0.4, max(width.x, width.y)));
}
void main() {
  if (plain) { shown = vec4(colour, 1.0); return; }
  float light = 0.68 + 0.32 * dot(normalize(facing), normalize(vec3(0.35, -0.45, 0.82)));
  vec3 base = colour;
  if (gridded) base = mix(base, line, max(0.9 * lines(500.0), 0.35 * lines(100.0)));
  shown = vec4(base * light, 1.0);
}`;

/** Width over height of a picture that shows the whole robot; a narrower one is seen from farther away. */
const WHOLE = 1.1;
/** Middle of the robot, ahead of its axle. */
const MIDDLE_MM = 220;

/** Places and normals, a triangle after the other; edges, a line after the other. */
class Builder {
  constructor() {
    /** @type {number[]} */
    this.numbers = [];
    /** @type {number[]} */
    this.lines = [];
  }

  /** @param {number[]} from @param {number[]} to */
  edge(from, to) {
    for (const point of [from, to]) this.lines.push(...point, 0, 0, 0);
  }

  /** @param {number[]} a @param {number[]} b @param {number[]} c @param {number[]} [normals] */
  triangle(a, b, c, normals) {
    const [u, v] = [a, b].map((p, i) => [0, 1, 2].map((k) => (i === 0 ? b[k] - p[k] : c[k] - a[k])));
    const flat = normals ?? [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const length = Math.hypot(...flat.slice(0, 3)) || 1;
    [a, b, c].forEach((p, i) => this.numbers.push(...p, ...(normals ? normals.slice(3 * i, 3 * i + 3) : flat.map((n) => n / length))));
  }

  quad(a, b, c, d) {
    this.triangle(a, b, c);
    this.triangle(a, c, d);
  }
}

function boxMesh() {
  const mesh = new Builder();
  const h = 0.5;
  for (let axis = 0; axis < 3; axis += 1) {
    for (const side of [-h, h]) {
      const corner = (u, v) => {
        const p = [0, 0, 0];
        p[axis] = side;
        p[(axis + 1) % 3] = side > 0 ? u : v;
        p[(axis + 2) % 3] = side > 0 ? v : u;
        return p;
      };
      mesh.quad(corner(-h, -h), corner(h, -h), corner(h, h), corner(-h, h));
      mesh.edge(corner(-h, -h), corner(-h, h));
      mesh.edge(corner(h, -h), corner(h, h));
    }
  }
  return mesh;
}

/** Along z; a cone if its top has no width. @param {number} top radius */
function roundMesh(top) {
  const mesh = new Builder();
  const sides = 28;
  const at = (i, r, z) => [r * Math.cos((2 * Math.PI * i) / sides), r * Math.sin((2 * Math.PI * i) / sides), z];
  for (let i = 0; i < sides; i += 1) {
    const [a, b, c, d] = [at(i, 0.5, -0.5), at(i + 1, 0.5, -0.5), at(i + 1, top, 0.5), at(i, top, 0.5)];
    const [n, m] = [at(i, 1, 0.5 - top), at(i + 1, 1, 0.5 - top)];
    mesh.edge(a, b);
    if (top > 0) mesh.edge(d, c);
    mesh.triangle(a, b, c, [...n, ...m, ...m]);
    mesh.triangle(a, c, d, [...n, ...m, ...n]);
    mesh.triangle([0, 0, 0.5], at(i, top, 0.5), at(i + 1, top, 0.5));
    mesh.triangle([0, 0, -0.5], at(i + 1, 0.5, -0.5), at(i, 0.5, -0.5));
  }
  return mesh;
}

/** Heights on a grid. @typedef {{from_mm: [number, number], step_mm: number, columns: number, heights_mm: (number | null)[]}} Relief */

/** The level floor goes with the robot; a relief stays. @param {Relief | null} relief */
function groundMesh(relief) {
  const mesh = new Builder();
  if (!relief) {
    const far = 6000;
    mesh.quad([-far, -far, 0], [far, -far, 0], [far, far, 0], [-far, far, 0]);
    return mesh;
  }
  const { from_mm: from, step_mm: step, columns, heights_mm: heights } = relief;
  const corner = (column, row) => [from[0] + column * step, from[1] + row * step, heights[row * columns + column] ?? NaN];
  for (let row = 0; row + 1 < heights.length / columns; row += 1) {
    for (let column = 0; column + 1 < columns; column += 1) {
      const four = [corner(column, row), corner(column + 1, row), corner(column + 1, row + 1), corner(column, row + 1)];
      if (four.every((p) => Number.isFinite(p[2]))) mesh.quad(four[0], four[1], four[2], four[3]);
    }
  }
  return mesh;
}

/** @param {WebGL2RenderingContext} gl */
function program(gl) {
  const made = gl.createProgram();
  for (const [kind, source] of /** @type {[number, string][]} */ ([[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]])) {
    const shader = /** @type {WebGLShader} */ (gl.createShader(kind));
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader) ?? "shader");
    gl.attachShader(made, shader);
  }
  gl.bindAttribLocation(made, 0, "place");
  gl.bindAttribLocation(made, 1, "normal");
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made) ?? "program");
  gl.useProgram(made);
  return made;
}

/** @param {WebGL2RenderingContext} gl @param {number[]} numbers */
function uploaded(gl, numbers) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
  for (const index of [0, 1]) {
    gl.enableVertexAttribArray(index);
    gl.vertexAttribPointer(index, 3, gl.FLOAT, false, 24, 12 * index);
  }
  return { array, count: numbers.length / 6 };
}

/** @param {OffscreenCanvas} canvas @param {import("./shape.js").Geometry} geometry @param {Relief | null} relief */
function painter(canvas, geometry, relief) {
  const gl = canvas.getContext("webgl2", { antialias: true });
  if (!gl) throw new Error("WebGL 2 is missing");
  const made = program(gl);
  const uniform = Object.fromEntries(["world", "seen", "colour", "line", "gridded", "plain"].map((name) => [name, gl.getUniformLocation(made, name)]));
  const parts = { box: boxMesh(), cylinder: roundMesh(0.5), cone: roundMesh(0), ground: groundMesh(relief) };
  const meshes = Object.fromEntries(Object.entries(parts).map(([name, mesh]) => [name, { faces: uploaded(gl, mesh.numbers), edges: uploaded(gl, mesh.lines) }]));
  const pixel = new Uint8Array(4);
  gl.enable(gl.DEPTH_TEST);
  // Faces lie a little behind their own edges.
  gl.enable(gl.POLYGON_OFFSET_FILL);
  gl.polygonOffset(1, 1);
  const draw = (mesh, at, colour, edge) => {
    const { faces, edges } = meshes[mesh];
    gl.uniformMatrix4fv(uniform.world, false, at);
    gl.uniform3fv(uniform.colour, colour);
    gl.bindVertexArray(faces.array);
    gl.drawArrays(gl.TRIANGLES, 0, faces.count);
    if (!edge) return;
    gl.uniform1i(uniform.plain, 1);
    gl.uniform3fv(uniform.colour, edge);
    gl.bindVertexArray(edges.array);
    gl.drawArrays(gl.LINES, 0, edges.count);
    gl.uniform1i(uniform.plain, 0);
  };
  /** @param {{pose: import("./solids.js").SpacePose, colours: Object<string, number[]>, camera: {turn: number, height: number, distance: number}}} told */
  return ({ pose, colours, camera: { turn, height, distance } }) => {
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(colours.sky[0], colours.sky[1], colours.sky[2], 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    // The middle of the robot is before its axle, wherever it heads.
    const heading = (pose.yaw_deg * Math.PI) / 180;
    /** @type {[number, number, number]} */
    const target = [pose.x_mm + MIDDLE_MM * Math.cos(heading), pose.y_mm + MIDDLE_MM * Math.sin(heading), pose.z_mm + 20];
    const aspect = canvas.width / Math.max(1, canvas.height);
    const away = distance * Math.max(1, WHOLE / aspect);
    const flat = away * Math.cos(height);
    const eye = looking([target[0] + flat * Math.cos(turn), target[1] + flat * Math.sin(turn), target[2] + away * Math.sin(height)], target);
    gl.uniformMatrix4fv(uniform.seen, false, multiply(perspective(0.6, aspect, 50, 30_000), eye));
    gl.uniform3fv(uniform.line, colours.line);
    gl.uniform1i(uniform.gridded, 1);
    // In steps of the grid, so that the floor's lines stand still.
    const floor = (v) => 500 * Math.round(v / 500);
    draw("ground", relief ? moved([0, 0, 0]) : moved([floor(pose.x_mm), floor(pose.y_mm), 0]), colours.ground);
    gl.uniform1i(uniform.gridded, 0);
    for (const solid of solids(geometry, pose)) draw(solid.mesh, solid.at, colours[solid.colour], solid.colour === "force" ? null : colours.edge);
    // What is asked for is drawn later; a pixel that is read waits until it is.
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  };
}

/** What was told last; `number` is that of the pose. @type {any} */
const told = { pose: null, number: 0, colours: null, camera: null };
/** @type {OffscreenCanvas | null} */
let canvas = null;
/** @type {ReturnType<typeof painter> | null} */
let paint = null;
let waiting = false;
/** A drawing is followed by so many times its time without one: what is drawn in software leaves the page its turn. */
const REST = 2;
/** From when on the next one may begin, ms. */
let rested_ms = 0;

function draw() {
  waiting = false;
  const begin_ms = performance.now();
  try {
    paint?.(told);
    rested_ms = performance.now() + REST * (performance.now() - begin_ms);
    self.postMessage({ drawn: told.number });
  } catch (error) {
    fail(error);
  }
}

const fail = (error) => self.postMessage({ failed: error instanceof Error ? error.message : String(error) });
self.addEventListener("message", ({ data }) => {
  try {
    if (data.canvas) {
      canvas = data.canvas;
      // A picture that no longer follows the robot must not look live.
      data.canvas.addEventListener("webglcontextlost", () => fail("the graphics were lost; reload the page"));
      paint = painter(data.canvas, data.geometry, data.relief);
    }
    if (data.size && canvas) [canvas.width, canvas.height] = data.size;
    for (const name of ["pose", "number", "colours", "camera"]) if (data[name]) told[name] = data[name];
    if (waiting || !paint || !told.pose || !told.colours || !told.camera) return;
    waiting = true;
    setTimeout(() => requestAnimationFrame(draw), Math.max(0, rested_ms - performance.now()));
  } catch (error) {
    fail(error);
  }
});
