// The npm package `canopen` on a bus that a socketcand server offers, told what to do line by line on standard input.
//
//   node peer.js HOST PORT BUS
//   {"id": 1, "js": "return 6 * 7"}   ->   {"id": 1, "value": 42}   or   {"id": 1, "error": "why", "code": 0x06020000}
//
// The source is the body of an async function. It sees `canopen`, `join` (below), what it keeps in `my`, and the list
// `heard` of what happened so far.
const Module = require('module');
const net = require('net');
const readline = require('readline');

// node-crc wants a compiler and Node's headers to be installed. canopen asks it for one CRC only: 16 bits, polynomial
// 1021h, nothing reflected, from 0. The package `crc` has it in JavaScript, and independent of Berth's.
const load = Module._load;
Module._load = (name, ...rest) => name === 'node-crc' ? { crc } : load(name, ...rest);

function crc(bits, reflect, polynomial, high, initial, initialHigh, final, finalHigh, data) {
    if (bits !== 16 || reflect || polynomial !== 0x1021 || initial || final)
        throw new Error('another CRC than CRC-16/XMODEM');

    const result = Buffer.alloc(2);
    result.writeUInt16BE(require('crc').crc16xmodem(data));
    return result;
}

const canopen = require('canopen');

const [host, port, busName] = process.argv.slice(2);
const heard = [];
const my = {};

// One node on the bus: a connection of its own, in raw mode.
function connect(receive) {
    return new Promise((resolve, reject) => {
        const socket = net.connect(Number(port), host);
        let waiting = '';
        let answers = 0;
        const send = ({ id, data }) => {
            const name = id.toString(16).toUpperCase().padStart(id > 0x7FF ? 8 : 3, '0');
            const bytes = [...data].map((byte) => byte.toString(16)).join(' ');
            socket.write(`< send ${name} ${data.length} ${bytes} >`);
        };
        const element = (words) => {
            if (words[0] === 'hi') {
                socket.write(`< open ${busName} >`);
            }
            else if (words[0] === 'ok') {
                answers += 1;
                if (answers === 1)
                    socket.write('< rawmode >');
                else
                    resolve({ send, close: () => socket.end() });
            }
            else if (words[0] === 'frame') {
                if (words[1].length <= 3)  // the package knows 11-bit identifiers only
                    receive({ id: parseInt(words[1], 16), data: Buffer.from(words.slice(3).join(''), 'hex') });
            }
            else if (words[0] === 'error') {
                reject(new Error(words.join(' ')));
            }
        };

        socket.setNoDelay(true);
        socket.on('error', reject);
        socket.on('data', (bytes) => {
            waiting += bytes.toString('latin1');
            for (let end = waiting.indexOf('>'); end >= 0; end = waiting.indexOf('>')) {
                const start = waiting.indexOf('<');
                const words = waiting.slice(start + 1, end).trim().split(/\s+/);
                waiting = waiting.slice(end + 1);
                element(words);
            }
        });
    });
}

// Puts a canopen.Device on the bus. What it tells goes to `heard`, each entry with the device's name.
async function join(name, device) {
    const line = await connect((frame) => device.receive(frame));
    const tell = (what, more) => heard.push({ device: name, what, ...more });
    device.addListener('message', line.send);
    device.emcy.on('emergency', ({ cobId, em }) =>
        tell('emergency', { cobId, code: em.code, register: em.register, info: em.info }));
    device.nmt.on('heartbeat', ({ deviceId, state }) => tell('heartbeat', { node: deviceId, state }));
    device.nmt.on('timeout', (node) => tell('timeout', { node }));
    device.nmt.on('changeState', (state) => tell('state', { state }));
    device.pdo.on('pdo', ({ cobId, dataObjects }) =>
        tell('pdo', { cobId, values: dataObjects.map((object) => object.value) }));
    device.sync.on('sync', (counter) => tell('sync', { counter: counter === undefined ? null : counter }));
    device.time.on('time', (date) => tell('time', { ms: date.getTime() }));
    device.lss.on('changeMode', (mode) => tell('lss mode', { mode }));
    device.lss.on('changeDeviceId', (node) => tell('lss node-ID', { node }));
    return { device, send: (id, hex) => line.send({ id, data: Buffer.from(hex, 'hex') }), close: line.close };
}

function plain(key, value) {
    if (typeof value === 'bigint')
        return value.toString();
    return value && value.type === 'Buffer' ? Buffer.from(value.data).toString('hex') : value;
}

const AsyncFunction = (async () => {}).constructor;
const lines = readline.createInterface({ input: process.stdin });
lines.on('line', async (line) => {
    const { id, js } = JSON.parse(line);
    let answer;
    try {
        const value = await new AsyncFunction('canopen', 'join', 'my', 'heard', js)(canopen, join, my, heard);
        answer = { id, value: value === undefined ? null : value };
    }
    catch (error) {
        answer = { id, error: String(error.message || error), code: error.code };
    }
    process.stdout.write(JSON.stringify(answer, plain) + '\n');
});
lines.on('close', () => process.exit(0));
