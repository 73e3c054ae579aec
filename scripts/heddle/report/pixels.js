// Pixels: from the page's elements, or on demand from a file beside the page, to float32. The other end is
// heddle/study_images.py: deflated bits, each less the one to its left, the most significant bytes first.

const halves = (() => {
  let made = null;
  return () => {
    if (made) return made;
    made = new Float32Array(65536);
    for (let bits = 0; bits < 65536; bits++) {
      const sign = bits & 0x8000 ? -1 : 1, exponent = (bits >> 10) & 31, mantissa = bits & 1023;
      if (exponent === 31) made[bits] = mantissa ? NaN : sign * Infinity;
      else made[bits] = sign * (exponent ? 2 ** (exponent - 15) * (1 + mantissa / 1024) : 2 ** -14 * (mantissa / 1024));
    }
    return made;
  };
})();

async function inflate(text) {
  if (typeof DecompressionStream === 'undefined') throw new Error('this browser is too old to unpack images (no DecompressionStream)');
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate-raw'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Float32Array of height x width x channels. head: {width, height, channels, type}
async function unpack(head, text) {
  const planes = await inflate(text);
  const {width, height, channels, type} = head;
  const count = width * height, size = {f32: 4, f16: 2, u8: 1}[type];
  if (planes.length !== count * channels * size) throw new Error('an image of this page is damaged: its length is wrong');
  const bits = new Uint32Array(count * channels);
  for (let c = 0; c < channels; c++) {
    for (let y = 0; y < height; y++) {
      let last = 0;
      for (let x = 0; x < width; x++) {
        let value = 0;
        for (let plane = 0; plane < size; plane++) value = (value << 8) | planes[(plane * channels + c) * count + y * width + x];
        last = (last + value) >>> 0;
        if (size < 4) last &= size === 2 ? 0xffff : 0xff;
        bits[(y * width + x) * channels + c] = last;
      }
    }
  }
  if (type === 'f32') return new Float32Array(bits.buffer);
  const half = type === 'f16' ? halves() : null;
  return Float32Array.from(bits, half ? (each) => half[each] : (each) => each / 255);
}

const ready = document.readyState === 'loading' ? new Promise((done) => addEventListener('DOMContentLoaded', done)) : Promise.resolve();
async function embedded(head) {
  let element = document.getElementById(head.id);
  if (!element) {  // the page is still being read
    await ready;
    element = document.getElementById(head.id);
  }
  return {...head, values: await unpack(head, element.textContent)};
}

// Files beside the page are scripts that call this: a page from disk may read nothing else.
const waiting = new Map();
window.heddleImage = (name, head, text) => {
  const file = `images/${name}.js`;
  if (waiting.has(file)) waiting.get(file).found = {head, text};
};
function beside(file) {
  return new Promise((done, failed) => {
    const script = make('script', {src: file});
    const wait = {found: null};
    waiting.set(file, wait);
    script.onload = () => {
      script.remove();
      waiting.delete(file);
      if (wait.found) unpack(wait.found.head, wait.found.text).then((values) => done({...wait.found.head, values}), failed);
      else failed(new Error(`'${file}' holds another image`));
    };
    script.onerror = () => {
      script.remove();
      waiting.delete(file);
      failed(new Error(`the whole image is not there: '${file}' should lie beside this page`));
    };
    document.head.append(script);
  });
}

// Images in use: whole as far as they are there, else as large as they are in the page. {width, height, channels (shown),
// values: at their whole size, isWhole, known(x, y): whether a pixel's value is the image's own, flip: values or null}
const pictures = new Map();
const KEPT_PICTURES = 10;
let decoded = 0;  // how many images were unpacked since the page was opened
function picture(key) {
  if (!pictures.has(key)) {
    decoded++;
    pictures.set(key, open_picture(key).catch((error) => { pictures.delete(key); throw error; }));
    for (const old of pictures.keys()) if (pictures.size > KEPT_PICTURES && old !== key) pictures.delete(old);
  } else {
    const found = pictures.get(key);  // the newest goes to the end
    pictures.delete(key);
    pictures.set(key, found);
  }
  return pictures.get(key);
}
async function open_picture(key) {
  const head = data.images[key];
  if (!head) throw new Error('the study keeps no image of it');
  const scale = data.level.scale;
  const small = await embedded(head.pixels);
  const made = {key, head, width: head.width, height: head.height, channels: small.channels, scale, isWhole: scale === 1,
    values: enlarged(small, head.width, head.height, scale), wholeTiles: [], flip: null, version: 0};
  if (head.flip && head.flip.pixels) made.flip = enlarged(await embedded(head.flip.pixels), head.width, head.height, scale);
  for (const tile of head.tiles || []) {
    if (!tile.pixels) continue;
    const part = await embedded(tile.pixels);
    paste(made, part, tile.x, tile.y);
    made.wholeTiles.push({x: tile.x, y: tile.y, width: part.width, height: part.height});
  }
  made.known = (x, y) => made.isWhole || made.wholeTiles.some((tile) =>
    x >= tile.x && y >= tile.y && x < tile.x + tile.width && y < tile.y + tile.height);
  return made;
}
function enlarged(image, width, height, scale) {
  if (scale === 1) return image.values;
  const values = new Float32Array(width * height * image.channels);
  for (let y = 0, to = 0; y < height; y++) {
    const line = Math.min(Math.floor(y / scale), image.height - 1) * image.width;
    for (let x = 0; x < width; x++) {
      const from = (line + Math.min(Math.floor(x / scale), image.width - 1)) * image.channels;
      for (let c = 0; c < image.channels; c++) values[to++] = image.values[from + c];
    }
  }
  return values;
}
function paste(image, part, x, y) {
  for (let row = 0; row < part.height; row++) {
    const from = row * part.width * part.channels;
    image.values.set(part.values.subarray(from, from + part.width * part.channels), ((y + row) * image.width + x) * image.channels);
  }
}
// Where the page has tiles of this image whole, the reference's are there too.
async function pasteReference(image, reference) {
  if (reference.isWhole) return;
  for (const tile of image.head.tiles || []) {
    if (!tile.reference || reference.known(tile.x, tile.y)) continue;
    const part = await embedded(tile.reference);
    if (reference.isWhole) return;
    paste(reference, part, tile.x, tile.y);
    reference.wholeTiles.push({x: tile.x, y: tile.y, width: part.width, height: part.height});
    reference.version++;
  }
}
async function makeWhole(key) {
  const image = await picture(key);
  if (image.isWhole && image.scale === 1) return image;
  const found = await beside(image.head.file);
  if (found.sha256 !== image.head.sha256) throw new Error(`'${image.head.file}' is not of this study`);
  if (found.channels === image.channels) image.values = found.values;
  else {
    const values = new Float32Array(found.width * found.height * image.channels);
    for (let i = 0, to = 0; i < found.values.length; i += found.channels) {
      for (let c = 0; c < image.channels; c++) values[to++] = found.values[i + c];
    }
    image.values = values;
  }
  image.isWhole = true;
  image.scale = 1;
  image.version++;
  return image;
}
