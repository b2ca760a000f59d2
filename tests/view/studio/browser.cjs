// A browser that looks at the studio's page: says what it saw as one line of JSON.
// node browser.cjs ADDRESS FOLDER CHROMIUM; playwright-core is found by NODE_PATH.
const { chromium } = require('playwright-core');
const [address, folder, executablePath] = process.argv.slice(2);

const shows = (text) => document.body.innerText.includes(text);

const number = (law) => {
  const found = document.body.innerText.match(new RegExp(`${law}: tip error ([0-9.]+) mm`));
  return found ? Number(found[1]) : NaN;
};

async function until(page, law, least, most) {
  // the page's own words, until its number lies between two
  const range = [law, least, most, number.toString()];
  await page.waitForFunction(([name, low, high, source]) => {
    const value = eval(source)(name);
    return value >= low && value <= high;
  }, range, { timeout: 150000, polling: 50 });
  return page.evaluate(([name, source]) => eval(source)(name), [law, number.toString()]);
}

async function hover(page) {
  // both laws at one place, before the arm moves
  await page.getByText('reset', { exact: true }).click();
  await page.waitForTimeout(1500);
  await page.getByText('play / pause', { exact: true }).click();
  await page.waitForTimeout(1500);
}

async function hostile(browser, port) {
  // a page of another origin, with the cookie of ours
  const context = await browser.newContext();
  const page = await context.newPage();
  await page.goto(address);
  await page.goto(`data:text/html,<script>window.found = new Promise(done => {
    const socket = new WebSocket('ws://127.0.0.1:${port}/', ['viser-v1.1.1']);
    socket.onopen = () => done('open'); socket.onerror = () => done('refused'); });</script>`);
  const answer = await page.evaluate(() => window.found);
  await context.close();
  return answer;
}

async function main() {
  const args = ['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--no-sandbox'];
  const browser = await chromium.launch({ executablePath, args });
  const errors = [];
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
  page.on('console', (message) => message.type() === 'error' && errors.push(message.text()));
  page.on('pageerror', (error) => errors.push(error.message));
  const begun = Date.now();
  await page.goto(address);
  await page.waitForFunction(shows, 'paper_ct: tip error', { timeout: 150000 });
  const seen = { picture: Date.now() - begun };
  // not at its start, where the vehicle stands on its reference
  seen.calm = await until(page, 'paper_ct', 20, 60);
  await page.getByText('gust', { exact: false }).first().click();
  seen.gust = await until(page, 'paper_ct', 4 * seen.calm, 1e6);
  seen.after = await until(page, 'paper_ct', 0, 1.5 * seen.calm);
  await page.screenshot({ path: `${folder}/desktop.png` });
  const paper = () => getComputedStyle(document.querySelector('.mantine-Paper-root')).backgroundColor.match(/\d+/g).map(Number);
  seen.light_paper = await page.evaluate(paper);
  // a slider: the wind along x, typed into its field and confirmed
  await page.getByText('world', { exact: true }).click();
  await page.getByText('wind force x (N)', { exact: true }).waitFor();
  const field = page.locator('input').nth(await page.evaluate(() => {
    const inputs = [...document.querySelectorAll('input')];
    const label = [...document.querySelectorAll('label, span, div')].filter((e) => e.textContent.trim() === 'wind force x (N)').pop();
    const row = label.getBoundingClientRect();
    const near = (e) => Math.abs(e.getBoundingClientRect().top - row.top) + (e.offsetWidth ? 0 : 1e9);
    return inputs.indexOf(inputs.filter((e) => e.type !== 'hidden').sort((a, b) => near(a) - near(b))[0]);
  }));
  await field.fill('2');
  const moved = Date.now();
  await field.press('Enter');
  seen.slider = await until(page, 'paper_ct', 4 * seen.calm, 1e6);
  seen.latency = Date.now() - moved;
  await page.close();
  const phone = await browser.newPage({ viewport: { width: 390, height: 844 }, hasTouch: true });
  await phone.goto(address);
  await phone.waitForFunction(shows, 'paper_pd: tip error', { timeout: 150000 });
  await phone.locator('.mantine-Notification-closeButton').click();
  await hover(phone);
  await phone.screenshot({ path: `${folder}/phone.png` });
  seen.width = await phone.evaluate(() => document.documentElement.scrollWidth);
  const boxes = (selectors) => selectors.map((name) => [...document.querySelectorAll(name)].map((e) => {
    const { left, right, top, bottom } = e.getBoundingClientRect();
    return { left, right, top, bottom, words: e.innerText };
  }));
  const parts = ['[data-dock-root]', '.mantine-Paper-root', '.mantine-Button-root', '.mantine-Tabs-tab'];
  [[seen.picture_box], [seen.sheet_box], seen.buttons, seen.tabs] = await phone.evaluate(boxes, parts);
  seen.legends = await phone.evaluate(() => [...document.querySelectorAll('.u-legend')].map((e) =>
    [...e.querySelectorAll('.u-series')].filter((row) => row.offsetHeight).map((row) => row.innerText)).filter((e) => e.length));
  seen.ticks = await phone.evaluate(() => Object.values(window.__viserTestpoints.uplots).map(({ chart }) => chart.axes[0]._values));
  await phone.close();
  const night = await browser.newPage({ viewport: { width: 1280, height: 800 }, colorScheme: 'dark' });
  await night.goto(address);
  await night.waitForFunction(shows, 'paper_ct: tip error', { timeout: 150000 });
  await night.waitForSelector('[data-mantine-color-scheme="dark"]', { state: 'attached', timeout: 30000 });
  seen.dark_paper = await night.evaluate(paper);
  await hover(night);
  await night.screenshot({ path: `${folder}/night.png` });
  await night.close();
  seen.hostile = await hostile(browser, new URL(address).port);
  seen.errors = errors;
  console.log(JSON.stringify(seen));
  await browser.close();
}

main().catch((error) => { console.error(error); process.exit(1); });
