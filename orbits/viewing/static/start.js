// A page: its view, and, if it comes from a server, the further samples of a run that grows.

import { View } from "./view.js";

const POLL = 1000, LATER = 5000;

export function startPage(root, data) {
  const view = new View(root, data);
  window.orbitsView = view;
  const { run } = view, { total } = run.header;
  if (data.follow) follow(view);
  else if (!run.complete) view.showBadge(`${run.ended || "not complete"} · ${run.numbers[run.length - 1] + 1} of ${total} samples`);
}

async function follow(view) {
  const { run } = view;
  let wait = POLL, known = -1; // of so many samples the approaches are known
  for (;;) {
    const how = run.complete ? run.ended : `${run.ended || "running"} · ${run.numbers[run.length - 1] + 1} of ${run.header.total} samples`;
    view.showBadge(how);
    try {
      if ((run.complete || run.ended) && known !== run.length) {
        known = run.length;
        view.learn(await asked("approaches"));
      }
      if (run.complete) return;
      await new Promise((done) => setTimeout(done, wait));
      view.grow(await asked(`more?first=${run.length}`));
      view.say(view.standing);
      wait = run.ended ? LATER : POLL; // a run that was ended may be resumed
    } catch (error) {
      if (error instanceof Refused) { view.say(error.message); return; }
      view.say("The server of this page does not answer: it was stopped, perhaps. The page goes on with the samples that it has.");
      wait = LATER;
    }
  }
}

class Refused extends Error {}

async function asked(what) {
  const answer = await fetch(what);
  if (!answer.ok) throw new Refused((await answer.text()).trim());
  return answer.json();
}
