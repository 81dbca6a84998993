// The map: tiles, robots, paths, landmarks. Coordinates are metres in the site's frame; Leaflet calls them [y, x].
import { colourOf, theme, onThemeChange } from '/theme.js';

const TILE = 128, RETRY_MS = 2000;
const at = (x, y) => L.latLng(y, x);
const still = window.matchMedia('(prefers-reduced-motion: reduce)');

// Tiles of the pyramid: level 0 is the finest, and Leaflet's zoom counts the other way.
const CellLayer = L.GridLayer.extend({
  initialize(site, levels, options) {
    L.GridLayer.prototype.initialize.call(this, options);
    this.site = site;
    this.levels = levels;
    this.versions = new Map();  // What is newest of each tile of each level.
    this.turn = 0;  // Versions begin anew with each whole map.
  },
  keyOf(coords) { return `${this.levels - 1 - coords.z}/${coords.x}/${-coords.y - 1}`; },
  createTile(coords, done) {
    const tile = document.createElement('img');
    tile.alt = '';
    tile.className = 'cell';
    tile.onload = () => done(null, tile);
    // A tile that is being replaced may be absent for a moment.
    tile.onerror = () => {
      tile.removeAttribute('src');
      tile.hidden = true;
      done(null, tile);
      setTimeout(() => { if (tile.isConnected && tile.hidden) this.show(tile, tile.dataset.key); }, RETRY_MS);
    };
    if (!this.show(tile, this.keyOf(coords))) setTimeout(() => done(null, tile));
    return tile;
  },
  // Whether there is something to load.
  show(tile, key) {
    const version = this.versions.get(key);
    tile.dataset.key = key;
    tile.version = version;
    tile.hidden = version === undefined;
    if (tile.hidden) return false;
    tile.src = `/api/sites/${this.site}/tiles/${key}.png?theme=${theme()}&v=${version}`;
    return true;
  },
  apply(changes) {
    if (changes.whole) { this.versions.clear(); this.turn += 1; }
    for (const [level, x, y, version] of changes.tiles) {
      const key = `${level}/${x}/${y}`;
      if (version === 0) this.versions.delete(key); else this.versions.set(key, `${this.turn}.${version}`);
    }
    this.refresh();
  },
  // Loads what has changed, of the level that is shown and where it is seen. Whatever else has changed is loaded when it comes
  // into view.
  refresh() {
    if (document.hidden || this._tileZoom === undefined) return;
    const seen = this._pxBoundsToTileRange(this._getTiledPixelBounds(this._map.getCenter()));
    for (const { coords, el } of Object.values(this._tiles)) {
      const key = this.keyOf(coords);
      if (coords.z === this._tileZoom && seen.contains(coords) && el.version !== this.versions.get(key)) this.show(el, key);
    }
  },
  reload() { for (const { coords, el } of Object.values(this._tiles)) this.show(el, this.keyOf(coords)); },
});

// Whether its poses are relative to its own start and say nothing about the map of its site.
export const isFragment = (robot) => robot.fragment;

export function robotState(robot, connected) {
  if (robot.phase === 'ended') return ['silent', 'Ended'];
  if (robot.phase === 'suspended' || !robot.alive) return ['silent', 'Suspended'];
  if (robot.stale) return ['silent', 'Stale'];
  if (!robot.pose) return ['unsure', 'Waiting for scans'];
  if (robot.pose.reason === 'lost' || robot.pose.reason === 'diverged') return ['lost', 'Lost'];
  if (robot.pose.reason === 'odometry_only') return ['unsure', 'Odometry only'];
  if (isFragment(robot)) return ['unsure', 'Not joined'];
  if (!robot.pose.localized) return ['unsure', 'Not localized'];
  if (robot.pose.reason === 'degenerate') return ['tracking', 'Corridor'];
  return ['tracking', connected ? 'Tracking' : 'Last known'];
}

function ellipsePoints(pose) {
  const [a, b, angle] = pose.ellipse;
  const points = [];
  for (let i = 0; i < 36; ++i) {
    const t = (i / 36) * 2 * Math.PI, u = a * Math.cos(t), v = b * Math.sin(t);
    points.push(at(pose.x + u * Math.cos(angle) - v * Math.sin(angle), pose.y + u * Math.sin(angle) + v * Math.cos(angle)));
  }
  return points;
}

export class SiteMap {
  constructor(element, site, map) {
    this.site = site;
    this.robots = new Map();
    this.shown = { path: true, smoothed: true, ellipse: true, landmarks: false, edits: true, disagreement: false };
    this.moved = false;
    const factor = map.resolution * 2 ** (map.levels - 1);
    this.leaflet = L.map(element, {
      crs: L.extend({}, L.CRS.Simple, { transformation: new L.Transformation(1 / factor, 0, -1 / factor, 0) }),
      minZoom: -3, maxZoom: map.levels + 3, zoomSnap: 0.25, zoomDelta: 1, attributionControl: false, center: [0, 0], zoom: map.levels - 1,
      fadeAnimation: !still.matches, zoomAnimation: !still.matches, markerZoomAnimation: !still.matches,
    });
    // All that it shows is in the lists beside it too; a screen reader would find nameless pictures here.
    this.leaflet.getPane('mapPane').setAttribute('aria-hidden', 'true');
    L.control.scale({ imperial: false, maxWidth: 140 }).addTo(this.leaflet);
    this.cells = new CellLayer(site, map.levels, {
      tileSize: TILE, minZoom: -3, maxZoom: map.levels + 3, minNativeZoom: 0, maxNativeZoom: map.levels - 1, updateWhenZooming: false,
    }).addTo(this.leaflet);
    this.landmarks = L.layerGroup().addTo(this.leaflet);
    this.edits = L.layerGroup().addTo(this.leaflet);
    const near = () => element.classList.toggle('near', this.leaflet.getZoom() > map.levels - 1);
    this.leaflet.on('zoomend', near);
    this.leaflet.on('move moveend', () => this.refresh());
    // Robots glide when they move, and not when the map does.
    this.leaflet.on('zoomstart viewreset', () => element.classList.remove('gliding'));
    // Once somebody has moved the map, it stays where they put it.
    for (const event of ['mousedown', 'wheel', 'touchstart', 'keydown']) element.addEventListener(event, () => { this.moved = true; }, { passive: true });
    onThemeChange(() => { if (this.leaflet) this.recolour(); });
  }

  remove() { this.stopPlacing?.(); this.leaflet.remove(); this.leaflet = null; }

  recolour() {
    this.cells.reload();
    for (const [name, drawn] of this.robots) {
      const color = colourOf(name);
      for (const line of [drawn.path, drawn.smoothed, drawn.ellipse]) line.setStyle({ color });
      drawn.marker.getElement()?.style.setProperty('--robot', color);
    }
  }

  applyTiles(changes) { this.cells.apply(changes); }

  // When the page is seen again.
  refresh() { this.cells.refresh(); }

  fit(map, force) {
    if (!map || map.tiles === 0 || (this.moved && !force)) return;
    if (force) this.moved = false;
    const [x0, y0, x1, y1] = map.bounds;
    this.leaflet.fitBounds([at(x0, y0), at(x1, y1)], { padding: [24, 24], animate: Boolean(force) && !still.matches });
  }

  draw(robot) {
    let drawn = this.robots.get(robot.name);
    if (drawn) return drawn;
    const color = colourOf(robot.name);
    const icon = L.divIcon({
      className: 'robot-icon', iconSize: [30, 30],
      html: '<svg viewBox="-15 -15 30 30" aria-hidden="true"><path class="body" d="M13 0 L-9 9 L-5 0 L-9 -9 Z"/></svg><span class="label"></span>',
    });
    drawn = {
      path: L.polyline([], { color, weight: 3, opacity: 0.85, interactive: false }),
      smoothed: L.polyline([], { color, weight: 3, opacity: 0.95, dashArray: '6 6', interactive: false }),
      ellipse: L.polygon([], { color, weight: 1.5, fillOpacity: 0.18, interactive: false }),
      marker: L.marker([0, 0], { icon, keyboard: false, interactive: false }),
      points: [],
    };
    this.robots.set(robot.name, drawn);
    return drawn;
  }

  toggle(layer, on) {
    if (on && !this.leaflet.hasLayer(layer)) layer.addTo(this.leaflet);
    if (!on && this.leaflet.hasLayer(layer)) layer.remove();
  }

  update(robots, connected) {
    this.leaflet.getContainer().classList.add('gliding');
    const here = new Set(robots.map((robot) => robot.name));
    for (const [name, drawn] of this.robots) {
      if (here.has(name)) continue;
      for (const layer of [drawn.path, drawn.smoothed, drawn.ellipse, drawn.marker]) layer.remove();
      this.robots.delete(name);
    }
    for (const robot of robots) {
      if (!robot.pose) continue;
      const drawn = this.draw(robot), { pose } = robot;
      if (isFragment(robot)) {
        for (const layer of [drawn.path, drawn.smoothed, drawn.ellipse, drawn.marker]) this.toggle(layer, false);
        continue;
      }
      const [state] = robotState(robot, connected);
      drawn.marker.setLatLng(at(pose.x, pose.y));
      this.toggle(drawn.marker, true);
      const element = drawn.marker.getElement();
      element.classList.remove('tracking', 'unsure', 'lost', 'silent');
      element.classList.add(state);
      element.dataset.robot = robot.name;
      element.style.setProperty('--robot', colourOf(robot.name));
      element.querySelector('.body').setAttribute('transform', `rotate(${(-pose.theta * 180) / Math.PI})`);
      element.querySelector('.label').textContent = robot.name;
      if (pose.ellipse) drawn.ellipse.setLatLngs(ellipsePoints(pose));
      this.toggle(drawn.ellipse, this.shown.ellipse && Boolean(pose.ellipse) && state !== 'silent');
      // Between two questions for the whole path it grows by what is seen here.
      const last = drawn.points[drawn.points.length - 1];
      if (last && pose.localized && Math.hypot(last[0] - pose.x, last[1] - pose.y) > 0.05 && drawn.points.length < 5000) {
        drawn.points.push([pose.x, pose.y]);
        drawn.path.addLatLng(at(pose.x, pose.y));
      }
      this.toggle(drawn.path, this.shown.path);
      this.toggle(drawn.smoothed, this.shown.smoothed);
    }
  }

  setPath(name, points, smoothed) {
    const drawn = this.robots.get(name);
    if (!drawn) return;
    const line = smoothed ? points : this.joined(points, drawn.points.slice(-200));
    if (!smoothed) drawn.points = line;
    drawn[smoothed ? 'smoothed' : 'path'].setLatLngs(line.map(([x, y]) => at(x, y)));
  }

  // The path that was answered may be seconds old: what was seen here since its end follows it.
  joined(points, seen) {
    const [x, y] = points[points.length - 1] ?? [Infinity, Infinity];
    let nearest = seen.length, least = 0.3;
    seen.forEach(([u, v], index) => {
      const apart = Math.hypot(u - x, v - y);
      if (apart <= least) [nearest, least] = [index, apart];
    });
    return points.concat(seen.slice(nearest + 1));
  }

  setLandmarks(landmarks) {
    this.landmarks.clearLayers();
    if (!this.shown.landmarks) return;
    const color = getComputedStyle(document.documentElement).getPropertyValue('--warn');
    for (const [x, y, corner] of landmarks) {
      this.landmarks.addLayer(L.circleMarker(at(x, y), { radius: corner ? 4 : 3, color, weight: 1.5, fillOpacity: corner ? 0.6 : 0, interactive: false }));
    }
  }

  // Where robots differ: a picture, and the area that it covers. Without one, nobody does.
  setDisagreement(url, area) {
    this.disagreement?.remove();
    this.disagreement = null;
    if (!url || !this.shown.disagreement) return;
    const [x0, y0, x1, y1] = area;
    this.disagreement = L.imageOverlay(url, [at(x0, y0), at(x1, y1)], { className: 'differs', interactive: false }).addTo(this.leaflet);
  }

  // Somebody presses on the map and drags. `draw` gets both ends as they move, `done` as they are in the end, or nothing if
  // Escape was pressed. `what` names what is being shown.
  drag(what, layer, draw, done) {
    this.stopPlacing?.();
    this.placing = what;
    const { leaflet } = this, element = leaflet.getContainer();
    const stop = new AbortController();
    let from = null;
    const finish = (to) => {
      stop.abort();
      this.stopPlacing = this.placing = null;
      layer.remove();
      element.classList.remove('placing');
      leaflet.dragging.enable();
      done(to && from, to);
    };
    const on = (target, event, listener) => target.addEventListener(event, listener, { signal: stop.signal });
    const metres = (event) => leaflet.mouseEventToLatLng(event);
    this.stopPlacing = () => finish(null);
    leaflet.dragging.disable();
    element.classList.add('placing');
    on(element, 'pointerdown', (event) => {
      if (event.target.closest('.leaflet-control')) return;
      element.setPointerCapture(event.pointerId);
      from = metres(event);
      draw(from, from);
      layer.addTo(leaflet);
    });
    on(element, 'pointermove', (event) => { if (from) draw(from, metres(event)); });
    on(element, 'pointerup', (event) => { if (from) finish(metres(event)); });
    on(window, 'keydown', (event) => { if (event.key === 'Escape') finish(null); });
  }

  // Somebody shows where a robot is: presses at its place and drags to where it looks. `done` gets the pose, or nothing.
  // Without a drag it looks where it looked before (`theta`).
  place(name, theta, done) {
    const arrow = L.polyline([], { color: colourOf(name), weight: 5, interactive: false });
    const pixel = (end) => this.leaflet.latLngToContainerPoint(end);
    this.drag(name, arrow, (from, to) => arrow.setLatLngs([from, to]), (from, to) => {
      if (!from) { done(null); return; }
      const dragged = pixel(from).distanceTo(pixel(to)) > 8;
      done({ x: from.lng, y: from.lat, theta: dragged ? Math.atan2(to.lat - from.lat, to.lng - from.lng) : theta });
    });
  }

  // Somebody shows a wall, or a box by two opposite corners. `done` gets both ends, or nothing.
  span(wall, done) {
    const style = { color: getComputedStyle(document.documentElement).getPropertyValue('--bad'), weight: 3, interactive: false };
    const shape = wall ? L.polyline([], style) : L.polygon([], { ...style, fillOpacity: 0.2 });
    const corners = (from, to) => [from, L.latLng(from.lat, to.lng), to, L.latLng(to.lat, from.lng)];
    this.drag('edit', shape, (from, to) => shape.setLatLngs(wall ? [from, to] : corners(from, to)), (from, to) => {
      done(from && { x: from.lng, y: from.lat }, to && { x: to.lng, y: to.lat });
    });
  }

  // Tiles show what is free, unknown and occupied; where robots must not drive is seen only here.
  setEdits(edits) {
    this.edits.clearLayers();
    if (!this.shown.edits) return;
    const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name);
    for (const edit of edits) {
      const keepOut = edit.kind === 'keep_out';
      const style = { color: colour(keepOut ? '--bad' : '--warn'), weight: keepOut ? 2 : 1, dashArray: '4 4', fillOpacity: keepOut ? 0.15 : 0, interactive: false };
      const places = edit.points.map(([x, y]) => at(x, y));
      this.edits.addLayer(edit.width > 0 ? L.polyline(places, style) : L.polygon(places, style));
    }
  }

  centre(pose) {
    this.moved = true;
    this.leaflet.setView(at(pose.x, pose.y), Math.max(this.leaflet.getZoom(), this.cells.levels - 1));
  }
}
