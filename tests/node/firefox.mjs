// Usage: node firefox.mjs < walk.json  What a person with Firefox does on pages, and what they show.
//
// The walk: {firefox, downloads, steps: [[verb, ...]]}. Verbs: open ADDRESS; wait
// EXPRESSION, until it is true; press KEY ("Shift+ArrowRight"); type TEXT; click SELECTOR;
// look NAME EXPRESSION; picture NAME SELECTOR. Prints JSON: {seen: {NAME: value, or PNG in base64},
// complaints, requests}; complaints hold errors, warnings and what the page's policy did not allow.
import { readFileSync } from "node:fs";
import puppeteer from "puppeteer-core";

const asked = JSON.parse(readFileSync(0, "utf8"));
const browser = await puppeteer.launch({
  browser: "firefox",
  executablePath: asked.firefox,
  headless: false, // without a display, even a virtual one, Firefox has no WebGL
  extraPrefsFirefox: {
    "security.fileuri.strict_origin_policy": true, // as users have it; puppeteer turns it off
    "media.autoplay.default": 0,
    "browser.download.folderList": 2,
    "browser.download.dir": asked.downloads,
    "browser.download.always_ask_before_handling_new_types": false,
  },
});
const seen = {};
const complaints = [];
const requests = [];
try {
  const page = await browser.newPage();
  await page.setViewport({ width: 1440, height: 1000 });
  page.on("console", (message) => ["error", "warn"].includes(message.type()) && complaints.push(message.text()));
  page.on("pageerror", (error) => complaints.push(error.message));
  page.on("request", (request) => requests.push(request.url().slice(0, 200)));
  // A page's recording is in no document: keep hold of it.
  await page.evaluateOnNewDocument(() => {
    const made = globalThis.Audio;
    globalThis.Audio = function () {
      return (globalThis.heard = new made());
    };
  });
  const settle = () => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  const until = async (expression) => {
    for (let tries = 0; tries < 600; tries++) {
      if (await page.evaluate(expression)) return;
      await new Promise((done) => setTimeout(done, 50));
    }
    throw new Error(`it did not come true: ${expression}`);
  };
  const verbs = {
    open: (address) => page.goto(address),
    wait: until,
    press: async (key) => {
      const [last, ...held] = key.split("+").reverse();
      for (const each of held) await page.keyboard.down(each);
      await page.keyboard.press(last);
      for (const each of held) await page.keyboard.up(each);
      await settle();
    },
    type: (text) => page.keyboard.type(text),
    click: async (selector) => {
      await page.locator(selector).click();
      await settle();
    },
    look: async (name, expression) => (seen[name] = await page.evaluate(expression)),
    picture: async (name, selector) => {
      await settle();
      seen[name] = await (await page.waitForSelector(selector)).screenshot({ encoding: "base64" });
    },
  };
  for (const [verb, ...rest] of asked.steps) await verbs[verb](...rest);
} finally {
  await browser.close();
}
console.log(JSON.stringify({ seen, complaints, requests }));
