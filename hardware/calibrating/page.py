"""The page that a person with a chessboard looks at."""

PAGE = b"""<!doctype html><html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width"><title>Calibration</title><style>
:root { color-scheme: light dark; --line: #8886; }
body { font: 16px/1.4 system-ui, sans-serif; margin: 0 auto; max-width: 1300px; padding: .8rem 1rem; }
#hint { font-size: 2.2rem; font-weight: 600; line-height: 1.2; min-height: 2.4em; margin: 0; }
#told { font-size: 1.5rem; padding: .3rem .7rem; border-radius: .4rem; margin: .5rem 0; background: #8883; }
#told.taken { background: #2e9e2e; color: white; } #told.waiting { background: #e08a1e; color: white; }
#told.problem { background: #c33; color: white; }
.pair { display: grid; grid-template-columns: 1fr 1fr; gap: .6rem; } figure { margin: 0; }
img { width: 100%; display: block; background: #8883; min-height: 8rem; } figcaption { opacity: .7; }
ul { list-style: none; padding: 0; margin: .8rem 0; display: flex; flex-wrap: wrap; gap: .4rem; }
li { border: 1px solid var(--line); border-radius: 1rem; padding: .1rem .7rem; }
li.met { background: #2e9e2e; color: white; border-color: #2e9e2e; }
button { font: inherit; padding: .4rem 1rem; margin-right: .6rem; }
#flash { position: fixed; inset: 0; background: #2e9e2e; opacity: 0; pointer-events: none; }
#flash.on { animation: flash .6s; } @keyframes flash { from { opacity: .7; } to { opacity: 0; } }
</style></head><body>
<p id="hint">Waiting for the cameras ...</p><p id="told">&nbsp;</p>
<div class="pair">
<figure><img id="left" alt="left camera"><figcaption>left</figcaption></figure>
<figure><img id="right" alt="right camera"><figcaption>right</figcaption></figure>
</div>
<ul id="goals"></ul>
<p><button id="finish">Calibrate with these</button><button id="forget">Forget the last pair</button>
<span id="count"></span></p>
<div id="flash"></div>
<script>
const at = id => document.getElementById(id);
let taken = 0, number = -1, over = false, sound = null;
addEventListener("pointerdown", () => { sound = sound || new AudioContext(); });
function beep() {
  if (!sound) return;  // browsers make no sound before a person has clicked
  const tone = sound.createOscillator();
  tone.frequency.value = 880; tone.connect(sound.destination); tone.start(); tone.stop(sound.currentTime + .12);
}
function flash() {
  at("flash").classList.remove("on"); void at("flash").offsetWidth; at("flash").classList.add("on"); beep();
}
function show(status) {
  at("hint").textContent = status.hint;
  at("told").textContent = status.told || "\\u00a0"; at("told").className = status.kind;
  at("count").textContent = status.count + " taken, kept in " + status.folder;
  at("goals").replaceChildren(...status.goals.map(goal => {
    const item = document.createElement("li");
    item.textContent = goal.name + " " + Math.min(goal.have, goal.need) + "/" + goal.need;
    if (goal.have >= goal.need) item.className = "met";
    return item;
  }));
  if (status.count > taken) flash();
  taken = status.count; over = status.over;
  at("finish").disabled = over || !status.enough; at("forget").disabled = over || !taken;
  if (status.number && status.number !== number) {
    number = status.number;
    for (const side of ["left", "right"]) at(side).src = "/" + side + ".jpg?" + number;
  }
}
async function follow() {
  try {
    show(await (await fetch("/status.json")).json());
  } catch (error) {
    at("told").textContent = "The program has ended, or does not answer: see the terminal.";
    at("told").className = over ? "" : "problem"; at("finish").disabled = at("forget").disabled = true;
    setTimeout(follow, 1000);
    return;
  }
  setTimeout(follow, 120);
}
for (const name of ["finish", "forget"]) at(name).onclick = () => fetch("/" + name, {method: "POST"});
follow();
</script></body></html>
"""
