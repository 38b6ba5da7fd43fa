// The page: shows what the server sends, and sends what the user does.

import { Clicks, smooth } from "./clicks.js";
import { Link } from "./link.js";
import { Plane } from "./plane.js";
import { Trace } from "./trace.js";

const NAMES = ["a", "b"];
const ARMED_MS = 3000;
const MESSAGE_MS = 8000;
const ALARMING = "#ff5c50";
const ALARMING_STATES = ["LOST", "DISPLACED", "NO IMAGES", "TRACKER SILENT", "NO SERVER"];
const FIT_PAUSE_MS = 60;
const REFUSED_CLICKS = {
  live: () => "No point set: the picture moves. Press S (Set clicks) to hold it first.",
  taken: (plane) => `No point set: plane ${plane} has one there already.`,
  outside: (plane) => `No point set: that is outside plane ${plane}'s picture.`,
};
const AXES = ["x", "y", "z"];
const get = (id) => document.getElementById(id);

const clicks = new Clicks();
const planes = {};
let chosen = "a";
let status = null;
let connected = false;
let everConnected = false;
let view = "overlay";
let drawn = [];
let noConnection = ""; // why the server has ended the connection
let fits = { a: null, b: null };
let heldShown = false; // whether the picture on the screen is the held one, which comes after the word that it is held
let stopArmed = null;
let sending = false;
let cancelling = false;

const trace = new Trace(get("trace"));
for (const name of NAMES) {
  planes[name] = new Plane(get(`plane-${name}`), name, {
    add: (plane, point) => change(() => clicks.add(plane, point)),
    remove: (plane) => change(() => clicks.removeLast(plane)),
    grab: () => clicks.remember(),
    move: (plane, index, point) => change(() => clicks.move(plane, index, point)),
    choose: (plane) => choose(plane, false),
    window: (plane, right, up) => slide(plane, { contrast: 3 * right, brightness: 2 * up }),
    refuse: (plane, why) => say(REFUSED_CLICKS[why](plane.toUpperCase()), true),
  });
}
const link = new Link({ status: takeStatus, trace: takeTrace, picture: takePicture, fit: takeFit, connection: takeConnection });

// From the server.

function takeConnection(now, reason = "") {
  noConnection = reason;
  if (now === connected && !reason) return;
  if (now && !connected) trace.clear();
  connected = now;
  everConnected ||= now;
  if (!now) loseClicks("The connection to the server was lost, and the held picture with it. Press S and click again.");
  if (now) wish();
  refresh();
}

/** Clicks belong to a picture that the server holds for this page; where that is gone, say so. */
function loseClicks(why) {
  if (status?.mode !== "live") return;
  if (status.held) {
    if (unsent()) say(why, true);
    end();
  }
  status.held = heldShown = false;
}

function unsent() {
  return NAMES.some((name) => clicks.points[name].length > 0);
}

function takeFit(fit) {
  if (fit.clicks !== clicks.points[fit.plane].length) return; // another click has come since
  fits[fit.plane] = fit;
  refresh();
}

let fitTimer = null;
/** Ask for the ellipses through the clicks, a moment after the last change. */
function askForFits() {
  clearTimeout(fitTimer);
  fitTimer = setTimeout(() => {
    for (const name of NAMES) if (clicks.points[name].length >= fewest()) link.fit(name, clicks.points[name]);
  }, FIT_PAUSE_MS);
}

function takeStatus(now) {
  const before = status;
  status = now;
  if (now.mode === "live") {
    if (now.held && !before?.held) begin();
    if (!now.held && before?.held) {
      heldShown = false;
      if (unsent() && !sending && !cancelling) say("The held picture is gone; another window may have taken it over. Press S and click again.", true);
      end();
    }
    if (before && !before.overlay && now.overlay) wish();
  } else if (before?.index !== now.index || before?.version !== now.version) {
    load(now);
  }
  refresh();
}

function takeTrace(rows) {
  trace.add(rows);
  const last = rows[rows.length - 1];
  AXES.forEach((axis, i) => (get(`shift-${axis}`).textContent = last[i + 1] === null ? "–" : signed(last[i + 1])));
}

function takePicture(header, bitmaps) {
  for (const name of NAMES) {
    if (bitmaps[name]) planes[name].show(bitmaps[name], header.planes[name].loop);
    else planes[name].loop = null;
    planes[name].ring = planes[name].loop;
    planes[name].missing = !bitmaps[name];
    planes[name].drawn = Boolean(header.planes[name]?.drawn);
  }
  heldShown = header.held;
  const now = performance.now();
  drawn.push(now);
  drawn = drawn.filter((at) => now - at < 3000);
  refresh();
}

// What is on the screen.

function refresh() {
  const live = status?.mode !== "annotate";
  const clicking = Boolean(status && connected && (live ? status.held && heldShown : true));
  const words = headline();
  document.documentElement.style.setProperty("--state", words.colour);
  get("state").textContent = words.state;
  get("reason").textContent = words.reason;
  get("reason").title = words.reason;
  get("detail").textContent = words.detail;
  get("pose-age").textContent = poseAge();
  // Nothing may move the pictures while they are being clicked; the headline says it then.
  get("alarm").hidden = !words.alarm || (clicking && live);
  get("alarm").textContent = words.alarm;
  // Instructions go in the header: the pictures must not move or shrink while they are being clicked.
  get("hint").hidden = !(clicking && live);
  get("hint").textContent = clicking && live ? `Picture held. ${sending ? "Clicks sent, waiting for the tracker …" : todo()}` : "";
  announce(words);
  get("live-panel").hidden = !live;
  get("numbers").hidden = !live || clicking;
  get("latency").textContent = milliseconds(status?.latency_ms);
  get("tracker-latency").textContent = milliseconds(status?.tracker_latency_ms);
  get("sigma-mm").textContent = sigma(status?.sigma_mm);
  AXES.forEach((axis, i) => (get(`axis-${axis}`).textContent = status?.axes?.[i] ?? axis));
  get("rate").textContent = drawn.length > 1 ? `${((drawn.length - 1) / ((drawn[drawn.length - 1] - drawn[0]) / 1000)).toFixed(1)} /s` : "–";
  get("click-panel").hidden = !(live && clicking);
  get("draw-panel").hidden = live;
  get("live-buttons").hidden = get("axes").hidden = clicking;
  for (const id of ["hold", "reset", "reference"]) get(id).disabled = !connected || (live && status?.state === "NO_TRACKER");
  get("accept").hidden = !status?.proposed;
  get("another").hidden = !(status?.proposed > 1);
  for (const id of ["accept", "another"]) get(id).disabled = !connected;
  get("hold").disabled = !connected || !status || !live || !status.seen.a || !status.seen.b;
  get("keep").disabled = !connected || !status?.has_clicks;
  get("click-keep").disabled = !enough();
  get("reference").disabled ||= status?.state !== "TRACKING";
  get("view").disabled = !status?.overlay || clicking;
  get("view").querySelector("span").textContent =
    view === "overlay" && status?.overlay && !clicking ? "Hide overlay" : "Show overlay";
  get("drawing").disabled = !status?.drawing;
  if (status?.drawing) get("drawing").value = status.drawing;
  get("send").disabled = !enough() || sending;
  for (const name of NAMES) {
    const plane = planes[name];
    const silence = live ? status?.stopped_s?.[name] : null;
    plane.doubtful = status?.state === "DEGRADED";
    if (live && (!status?.has_pose || clicking)) plane.loop = null;
    // The word that a ring is proposed may come after the picture with it.
    plane.proposed = Boolean(live && status?.proposed && !clicking);
    if (plane.proposed) plane.loop = plane.ring;
    plane.clicking = clicking;
    const fit = clicking && live && fits[name]?.clicks === clicks.points[name].length ? fits[name] : null;
    plane.ellipse = fit?.ellipse ?? null;
    plane.points = clicking ? clicks.points[name] : [];
    plane.curve = clicking && plane.points.length > 1 && !plane.ellipse ? smooth(plane.points, !live && get("closed").checked) : null;
    if (!live && !plane.points.length) plane.curve = status?.curves?.[name] ?? null;
    plane.root.classList.toggle("clicking", clicking);
    plane.root.classList.toggle("chosen", clicking && chosen === name);
    plane.root.classList.toggle("old", !connected || (live && !clicking && (status?.state === "NO_IMAGES" || plane.missing || typeof silence === "number")));
    plane.angle.textContent = status?.angles?.[name] ?? "";
    if (!clicking) plane.count.textContent = plane.bitmap ? (plane.drawn ? "overlay" : "film") : "";
    else plane.count.textContent = counted(plane, live, fit);
    plane.count.classList.toggle("enough", clicking && plane.points.length >= fewest() && !fit?.doubtful);
    plane.count.classList.toggle("doubtful", Boolean(fit?.doubtful));
    plane.say(remark(plane, name, live, silence));
    plane.drawMarks();
  }
  if (!live && status) refreshDrawing();
}

/** How many clicks there are, and how far they lie off the ellipse through them. */
function counted(plane, live, fit) {
  const n = plane.points.length;
  if (live && n < fewest()) return `${n} of ${fewest()}`;
  if (!fit?.ellipse) return `${n} points`;
  return `${n} points, ${fit.off} off the ellipse${fit.doubtful ? ": on the loop?" : ""}`;
}

function headline() {
  const colour = "#aaaaaa";
  if (!connected) {
    if (noConnection) return { colour: ALARMING, state: "NO SERVER", reason: noConnection, detail: "Reload to try again.", alarm: "This window shows nothing new." };
    if (!everConnected) return { colour, state: "CONNECTING", reason: "Connecting to the server …", detail: "", alarm: "" };
    const text = "Connection to the server lost. What is on the screen is old.";
    return { colour: ALARMING, state: "NO SERVER", reason: "Trying again …", detail: "The tracker may go on without this page.", alarm: text };
  }
  if (!status) return { colour, state: "CONNECTING", reason: "", detail: "", alarm: "" };
  if (status.mode === "annotate") {
    const saved = status.unsaved ? "not saved yet" : "all saved";
    return { colour: "#78beff", state: "DRAWING", reason: status.name, detail: `${status.done} of ${status.frames} pairs drawn, ${saved}`, alarm: "" };
  }
  return { colour: status.colour, state: status.state.replaceAll("_", " "), reason: reasonWords(), detail: detailWords(), alarm: status.alarm };
}

function poseAge() {
  if (!connected || status?.mode !== "live") return "";
  return typeof status.pose_age_s === "number" ? `Last good pose ${ago(status.pose_age_s)}` : "No pose yet";
}

/** Seconds in words that a reader takes in at a glance. */
function ago(seconds) {
  if (seconds < 1) return `${seconds.toFixed(1)} s ago`;
  return seconds < 120 ? `${Math.round(seconds)} s ago` : `${Math.floor(seconds / 60)} min ago`;
}

/** Tell screen readers once when the headline changes; what is wrong in detail is no news in a state that alarms by itself. */
let announced = "";
function announce(words) {
  const alarming = ALARMING_STATES.includes(words.state);
  const key = alarming ? words.state : `${words.state} ${words.alarm}`;
  if (key === announced) return;
  announced = key;
  const text = [words.state, words.alarm].filter(Boolean).join(". ");
  const urgent = alarming || Boolean(words.alarm);
  get("news").textContent = urgent ? "" : text;
  get("urgent-news").textContent = urgent ? text : "";
}

function reasonWords() {
  if (status.state === "WAITING_FOR_SEED" && status.hold_for_rounds) return "The recording has begun anew.";
  if (status.state === "WAITING_FOR_SEED" && status.sent) return "Clicks sent, waiting for the tracker …";
  if (status.proposed > 1) return `${status.proposed} rings are found: is this one the lasso?`;
  if (status.proposed) return "A ring is found: is it the lasso?";
  return status.reason || {
    TRACKING: "The loop is followed.",
    WAITING_FOR_SEED: "Click along the loop in both planes to begin.",
    WAITING_FOR_CALIBRATION: "No valid calibration yet.",
    LOST: "The loop is not found; looking for it.",
  }[status.state] || "";
}

function detailWords() {
  if (status.held) return "The stream goes on behind the held picture; Esc shows it again.";
  if (status.held_elsewhere) return "Somebody is setting clicks in another window.";
  if (status.state === "WAITING_FOR_SEED") {
    if (status.hold_for_rounds) return "The clicks hold for every round: the loop is followed from the clicked picture on.";
    if (status.proposed && !status.sent)
      return `Press Enter to take it,${status.proposed > 1 ? " N for the next," : ""} or S to set clicks.`;
    return status.sent ? "If nothing follows, press S and click again." : "Press S: the picture is held while you click.";
  }
  if (status.state === "NO_TRACKER") return "Start lasso_tracker; this page finds it by itself.";
  if (["TRACKER_SILENT", "NO_POSE", "NO_IMAGES"].includes(status.state)) return "Nothing is compensated now.";
  if (status.state === "LOST" || status.state === "DISPLACED") {
    if (!status.proposed) return "Nothing is compensated now. Press S to set clicks anew.";
    const next = status.proposed > 1 ? ", N for the next" : "";
    return `Nothing is compensated now. Enter begins anew with it${next}: its picture is the new reference, where a volume is to be registered.`;
  }
  if (status.state === "DEGRADED") return "There is a pose, but a less certain one.";
  return "";
}

function remark(plane, name, live, silence) {
  if (!plane.bitmap) {
    if (!live || !status) return "";
    if (!status.seen[name]) return "waiting for images …";
    return status.calibrated[name] ? "" : "images come, but no valid calibration";
  }
  if (live && typeof silence === "number") return `${status?.held_pictures?.[name] ? "picture held" : "no images"} for ${silence} s`;
  return plane.missing && live ? "no image of this plane" : "";
}

// Clicking.

function begin() {
  clicks.reset();
  fits = { a: null, b: null };
  for (const name of NAMES) planes[name].cross = null;
  choose("a");
}

function end() {
  clicks.reset();
  for (const name of NAMES) planes[name].whole();
}

function change(what) {
  what();
  if (status?.mode === "annotate") store();
  else askForFits();
  refresh();
}

function fewest() {
  return status?.clicks ?? 6;
}

function enough() {
  return NAMES.every((name) => clicks.points[name].length >= fewest());
}

function todo() {
  const lacking = NAMES.filter((name) => clicks.points[name].length < fewest());
  if (!lacking.length) return "Enter starts the tracking.";
  const words = lacking.map((name) => `${fewest() - clicks.points[name].length} more in plane ${name.toUpperCase()}`);
  return `Click along the loop, in order: ${words.join(", ")}.`;
}

function choose(name, focus = true) {
  chosen = name;
  if (focus) planes[name].marks.focus();
  for (const one of NAMES) planes[one].root.classList.toggle("chosen", planes[one].clicking && one === name);
}

/** Send a command; its answer is shown, whatever it is. */
async function ask(type, body, quiet = false) {
  try {
    const { text, file, name } = await link.ask(type, body);
    if (file) download(file, name);
    if (text) say(text);
    else if (!quiet) hush();
    return true;
  } catch (error) {
    say(error.message, true);
    return false;
  }
}

/** Hand a file that the server has made to the user, as any download. */
function download(text, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "application/yaml" }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

let silencer = null;
/** An answer; one that refuses stays until something else is said or it is closed. */
function say(text, bad = false) {
  get("message").hidden = false;
  get("message-text").textContent = text;
  get("answer-news").textContent = text;
  get("message").classList.toggle("bad", bad);
  clearTimeout(silencer);
  if (!bad) silencer = setTimeout(hush, MESSAGE_MS);
}

function hush() {
  clearTimeout(silencer);
  get("message").hidden = true;
  get("answer-news").textContent = "";
}

// Drawing centrelines into a recording.

function load(now) {
  clicks.reset(now.points);
  get("slider").max = now.frames - 1;
  get("slider").value = now.index;
  get("closed").checked = now.closed;
}

function refreshDrawing() {
  get("frame").textContent = `${status.index + 1} of ${status.frames}`;
  get("draw-help").textContent = "Click along the loop, in both planes.";
  get("previous").disabled = status.index === 0;
  get("next").disabled = status.index === status.frames - 1;
  get("copy").disabled = status.index === 0;
  get("save").disabled = !status.unsaved;
  get("draw-keep").disabled = !status.has_clicks;
}

/** Send the clicks and their curve to the server at every change: nothing is lost when the page is closed. */
function store() {
  const closed = get("closed").checked;
  const body = { index: status.index, closed, a: clicks.points.a, b: clicks.points.b };
  for (const name of NAMES) body[`curve_${name}`] = clicks.points[name].length > 2 ? smooth(clicks.points[name], closed) : [];
  ask("draw", body, true);
}

// Buttons and keys.

function wish() {
  const windows = {};
  for (const name of NAMES) windows[name] = { brightness: grey[name].brightness, contrast: Math.exp(grey[name].contrast * Math.LN2 * 0.999) };
  link.want(view, windows);
  get("window-reset").disabled = NAMES.every((name) => !grey[name].brightness && !grey[name].contrast);
}

/** Move a plane's sliders by the given amounts. */
function slide(plane, steps) {
  for (const [kind, by] of Object.entries(steps)) {
    const slider = get(`${kind}-${plane}`);
    grey[plane][kind] = Math.min(Number(slider.max), Math.max(Number(slider.min), grey[plane][kind] + by));
    slider.value = grey[plane][kind];
  }
  wish();
}

/** The sliders' values, finer than their steps: small drags add up. */
const grey = { a: { brightness: 0, contrast: 0 }, b: { brightness: 0, contrast: 0 } };

function takeSlider(plane, kind) {
  grey[plane][kind] = Number(get(`${kind}-${plane}`).value);
  wish();
}

function reset() {
  // A reset cannot be undone: it takes a second press within three seconds.
  if (stopArmed) {
    stopArmed();
    ask("reset");
    return;
  }
  const label = get("reset").innerHTML;
  get("reset").classList.add("armed");
  get("reset").lastChild.textContent = " Press again";
  const timer = setTimeout(() => stopArmed?.(), ARMED_MS);
  stopArmed = () => {
    clearTimeout(timer);
    get("reset").classList.remove("armed");
    get("reset").innerHTML = label;
    stopArmed = null;
  };
}

const deeds = {
  accept: () => ask("accept"),
  another: () => ask("next"),
  hold: () => ask("hold"),
  cancel: async () => {
    cancelling = true;
    if (await ask("release")) clicks.reset();
    cancelling = false;
  },
  send: async () => {
    sending = true;
    refresh();
    say("The clicks are on their way to the tracker …");
    if (await ask("seed", { a: clicks.points.a, b: clicks.points.b })) {
      clicks.reset();
      // The next status says so too; a key pressed before it comes is not one of somebody who clicks.
      takeStatus({ ...status, held: false });
    }
    sending = false;
    refresh();
  },
  keep: () => ask("clicks_file"),
  "click-keep": () => ask("clicks_file", { a: clicks.points.a, b: clicks.points.b }),
  "draw-keep": () => ask("clicks_file"),
  undo: () => change(() => clicks.undo()),
  "draw-undo": () => change(() => clicks.undo()),
  clear: () => change(() => clicks.clear(chosen)),
  "draw-clear": () => change(() => clicks.clear(chosen)),
  reset,
  reference: () => ask("set_reference"),
  view: () => {
    view = view === "overlay" ? "film" : "overlay";
    wish();
    refresh();
  },
  "window-reset": () => NAMES.forEach((name) => slide(name, { brightness: -grey[name].brightness, contrast: -grey[name].contrast })),
  "message-close": hush,
  previous: () => ask("go", { index: status.index - 1 }),
  next: () => ask("go", { index: status.index + 1 }),
  copy: () => ask("go", { index: status.index, copy: true }),
  save: () => ask("save"),
};
for (const [id, deed] of Object.entries(deeds)) get(id).addEventListener("click", deed);
for (const name of NAMES)
  for (const kind of ["brightness", "contrast"]) get(`${kind}-${name}`).addEventListener("input", () => takeSlider(name, kind));
addEventListener("beforeunload", (event) => {
  // The browser asks; a page cannot say why.
  if (status?.mode === "live" && (unsent() || sending)) event.preventDefault();
});
get("help").addEventListener("toggle", () => get("help").open && get("help").scrollIntoView({ block: "end" }));
get("drawing").addEventListener("change", () => ask("style", { drawing: get("drawing").value }));
get("slider").addEventListener("input", () => ask("go", { index: Number(get("slider").value) }));
get("closed").addEventListener("change", () => change(() => {}));

/** Press a button by its key, if it is shown and enabled; else say why nothing happens. */
function press(...ids) {
  const shown = ids.filter((one) => get(one).offsetParent !== null);
  const id = shown.find((one) => !get(one).disabled);
  if (id) get(id).click();
  else if (shown.length) say(`Not done: ${whyNot(shown[0])}`, true);
}

function whyNot(id) {
  if (!connected) return "there is no connection to the server.";
  if (id === "send") return sending ? "the clicks are on their way already." : todo();
  if (id === "keep") return "no clicks have been sent from this page yet. Press S to set some.";
  if (id === "click-keep") return todo();
  if (id === "draw-keep") return "tracking needs 6 clicks or more in both planes of this pair.";
  if (id === "hold") return "there are no images of both planes yet.";
  if (id === "reference") return "the reference can be set only while the loop is followed.";
  if (id === "reset") return "the tracker is not running.";
  if (id === "view") return "there is no overlay.";
  if (id === "window-reset") return "the grey values are automatic already.";
  return "there is nothing to do.";
}

const keys = {
  s: () => press("hold"),
  Enter: () => press("send", "accept"),
  Escape: () => press("cancel"),
  z: () => press("undo", "draw-undo"),
  Backspace: () => press("undo", "draw-undo"),
  x: () => press("clear", "draw-clear"),
  f: () => press("click-keep", "draw-keep", "keep"),
  r: () => press("reset"),
  t: () => press("reference"),
  v: () => press("view"),
  w: () => press("window-reset"),
  o: () => {
    const box = get("drawing");
    if (box.disabled) return;
    box.selectedIndex = (box.selectedIndex + 1) % box.options.length;
    box.dispatchEvent(new Event("change"));
  },
  n: () => press("another", "next"),
  PageDown: () => press("next"),
  p: () => press("previous"),
  PageUp: () => press("previous"),
  d: () => press("copy"),
  c: () => press("closed"),
  a: () => choose("a"),
  b: () => choose("b"),
  0: () => NAMES.forEach((name) => planes[name].whole()),
  "?": () => (get("help").open = !get("help").open),
  "+": () => planes[chosen].zoomBy(1.25, crossPlace()),
  "=": () => planes[chosen].zoomBy(1.25, crossPlace()),
  "-": () => planes[chosen].zoomBy(0.8, crossPlace()),
  "[": () => slide(chosen, { brightness: -0.1 }),
  "]": () => slide(chosen, { brightness: 0.1 }),
  "{": () => slide(chosen, { contrast: -0.2 }),
  "}": () => slide(chosen, { contrast: 0.2 }),
  ArrowLeft: (far) => planes[chosen].step(-far, 0),
  ArrowRight: (far) => planes[chosen].step(far, 0),
  ArrowUp: (far) => planes[chosen].step(0, -far),
  ArrowDown: (far) => planes[chosen].step(0, far),
  " ": () => {
    const plane = planes[chosen];
    if (plane.clicking && plane.cross) change(() => clicks.add(chosen, plane.cross.slice()));
  },
};

function crossPlace() {
  const plane = planes[chosen];
  return plane.clicking && plane.cross ? plane.toCanvas(plane.cross) : undefined;
}

document.addEventListener("keydown", (event) => {
  const letter = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if ((event.ctrlKey || event.metaKey) && letter === "z") {
    event.preventDefault();
    keys.z();
    return;
  }
  if ((event.ctrlKey || event.metaKey) && letter === "s") {
    event.preventDefault();
    press("save");
    return;
  }
  if (event.ctrlKey || event.metaKey || event.altKey || !keys[letter]) return;
  // Buttons, sliders and lists keep the keys that they use themselves.
  const kind = event.target.tagName;
  if ((kind === "BUTTON" || kind === "SUMMARY") && ["Enter", " "].includes(event.key) && event.target.offsetParent !== null) return;
  if ((kind === "INPUT" || kind === "SELECT") && (event.key.startsWith("Arrow") || event.key === " " || event.key.startsWith("Page"))) return;
  if (kind === "SELECT") return;
  event.preventDefault();
  keys[letter](event.shiftKey ? 10 : 1);
});

setInterval(() => {
  trace.draw();
  if (performance.now() - (drawn[drawn.length - 1] ?? 0) > 3000) drawn = [];
}, 100);

const signed = (value) => `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(1)}`;
const sigma = (value) => (typeof value !== "number" ? "–" : value < 0.1 ? "< 0.1" : value.toFixed(1));
const milliseconds = (value) => (typeof value === "number" ? `${Math.round(value)} ms` : "–");
refresh();
