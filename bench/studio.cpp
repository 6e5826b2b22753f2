// Berth Studio's server: what its pages, its ring of frames and its clients cost. Aims are issue 40's.
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "bench/tools/figures.hpp"
#include "berth/base/random.hpp"
#include "berth/design/machine.hpp"
#include "berth/io/loop.hpp"
#include "berth/io/stream.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/sim/world.hpp"
#include "berth/studio/pages.hpp"
#include "berth/studio/search.hpp"
#include "berth/studio/studio.hpp"

using namespace berth;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

namespace {

using Figures = std::vector<bench::Figure>;

// What a machine says: heartbeats, PDOs with values that change, SDO transfers with values that change, EMCYs, SYNC.
can::Frame drawn(Random& random, unsigned i) {
  const auto node = static_cast<std::uint32_t>(1 + random.below(30));
  const auto byte = [&] { return static_cast<std::uint8_t>(random.below(256)); };
  switch (i % 8) {
    case 0: return can::Frame::base(0x700 + node, {5});
    case 1: return can::Frame::base(0x080, {});
    case 2: return can::Frame::base(0x600 + node, {0x40, 0x00, 0x60, byte(), 0, 0, 0, 0});
    case 3: return can::Frame::base(0x580 + node, {0x43, 0x00, 0x60, byte(), byte(), byte(), byte(), byte()});
    case 4: return can::Frame::base(0x080 + node, {0x10, 0x81, 0x11, 0, 0, 0, 0, 0});
    default:
      return can::Frame::base(0x180 + 0x100 * (i % 3) + node,
                              {byte(), byte(), byte(), byte(), byte(), byte(), byte(), byte()});
  }
}

void fill(studio::FrameRing& ring, std::size_t frames) {
  Random random(40);
  for (std::size_t i = 0; i < frames; ++i) {
    ring.put(static_cast<std::uint8_t>(i % 4), drawn(random, static_cast<unsigned>(random.below(8))),
             rt::Time(rt::Duration(static_cast<std::int64_t>(i) * 31'250)), false);
  }
}

double searched_ms(const studio::FrameRing& ring, const studio::Message& wanted) {
  static const std::vector<std::string> buses{"field", "drives", "doors", "line"};
  bench::Rounds rounds;
  for (int round = 0; round < 5; ++round) {
    const bench::Watch watch;
    studio::Search search(ring, buses, wanted);
    while (!search.step(2000)) {
    }
    static_cast<void>(search.answer());
    rounds.add(watch.seconds() * 1000);
  }
  return rounds.median();
}

void of_the_ring(Figures& figures) {
  studio::FrameRing ring;
  fill(ring, ring.most());
  figures.push_back(
      bench::at_most("memory of the ring, 1,048,576 frames", static_cast<double>(ring.most()) * 32 / 1e6, 64, "MB"));
  for (const char* const filter : {"sdo 605#", "heartbeat", "abort", "705", "drives tpdo", "no such word"}) {
    studio::Message wanted{.kind = studio::MessageKind::frames, .id = "1", .count = 50};
    wanted.filter = filter;
    figures.push_back(bench::at_most(fmt::format("filter \"{}\" over all of them, median of 5", filter),
                                     searched_ms(ring, wanted), 150, "ms"));
  }
  studio::Message range{.kind = studio::MessageKind::frames, .id = "1", .count = 2000};
  range.from = 500'000;
  figures.push_back({"a range of 2000 rows", fmt::format("{:.1f} ms", searched_ms(ring, range))});
}

void of_the_pages(Figures& figures) {
  std::size_t bytes = 0;
  for (const auto& page : studio::built_pages()) bytes += page.size;
  if (bytes == 0) {
    figures.push_back({"size of the pages, compressed", "not built (web/dist)", "700 kB"});
  } else {
    figures.push_back(bench::at_most("size of the pages, compressed", static_cast<double>(bytes) / 1000, 700, "kB"));
  }
}

// ---- clients ----

constexpr std::string_view machine_text = R"(
[machine]
name = "bench"
[bus.field]
port = "sim"
bitrate = 1_000_000
[bus.drives]
port = "sim"
bitrate = 1_000_000
[bus.doors]
port = "sim"
bitrate = 1_000_000
[bus.line]
port = "sim"
bitrate = 1_000_000
)";

/// A client that takes the live frames, on a thread of its own, until its connection ends.
class Client {
 public:
  explicit Client(const studio::Studio& studio)
      : thread_([this, port = studio.where().port, token = studio.tokens().of(command::Role::configure)] {
          run(port, token);
        }) {}
  ~Client() {
    ends_ = true;
    thread_.join();
  }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  std::atomic<std::uint64_t> frames{0}, bytes{0};
  std::atomic<bool> ready{false};

 private:
  void run(std::uint16_t port, const std::string& token) {
    const int fd = io::begin_connect(io::look_up({"127.0.0.1", port}).value().front());
    const auto say = [&](std::string_view text) {
      while (!text.empty() && !ends_) {
        const auto n = ::send(fd, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
        if (n > 0) text.remove_prefix(static_cast<std::size_t>(n));
        if (n <= 0) std::this_thread::sleep_for(1ms);
      }
    };
    say(
        fmt::format("GET /api/v1/socket HTTP/1.1\r\nHost: 127.0.0.1:{0}\r\nOrigin: http://127.0.0.1:{0}\r\nUpgrade: "
                    "websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: "
                    "dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: berth.v1, token.{1}\r\n\r\n",
                    port, token));
    std::string in;
    bool open = false;
    std::array<char, 65536> buffer{};
    while (!ends_) {
      pollfd wait{fd, POLLIN, 0};
      if (::poll(&wait, 1, 20) <= 0) continue;
      const auto n = ::recv(fd, buffer.data(), buffer.size(), MSG_DONTWAIT);
      if (n == 0) break;
      if (n < 0) continue;
      in.append(buffer.data(), static_cast<std::size_t>(n));
      if (!open) {
        const auto head = in.find("\r\n\r\n");
        if (head == std::string::npos) continue;
        in.erase(0, head + 4);
        open = true;
        const std::string live = R"({"type":"live","frames":true})";
        const std::string frame{static_cast<char>(0x81), static_cast<char>(0x80U | live.size()), 0, 0, 0, 0};
        say(frame + live);  // before the answer a client may send nothing (RFC 6455 §4.1)
        ready = true;
      }
      take(in);
    }
    ::close(fd);
  }
  // A server's frames are not masked. Only binary ones are counted, in the first piece of which the count of frames is.
  void take(std::string& in) {
    for (;;) {
      if (in.size() < 2) return;
      std::size_t size = static_cast<unsigned char>(in[1]) & 127U;
      const std::size_t more = size == 126 ? 2 : size == 127 ? 8 : 0;
      if (in.size() < 2 + more) return;
      if (more > 0) size = 0;
      for (std::size_t i = 0; i < more; ++i) size = size << 8U | static_cast<unsigned char>(in[2 + i]);
      if (in.size() < 2 + more + size) return;
      const int code = in[0] & 15;
      if (code == 1 || code == 2) kind_ = code;
      if (code == 2 && size >= 24) {
        frames += static_cast<unsigned char>(in[4 + more]) |
                  static_cast<unsigned>(static_cast<unsigned char>(in[5 + more])) << 8U;
      }
      if (code < 8 && kind_ == 2) bytes += 2 + more + size;
      in.erase(0, 2 + more + size);
    }
  }
  int kind_ = 0;
  std::atomic<bool> ends_{false};
  std::thread thread_;
};

double thread_seconds() {
  timespec time{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_nsec) / 1e9;
}

/// Four buses at 8,000 frames a second each, and a server of Studio that is told of them.
class Load {
 public:
  explicit Load(const design::Machine& machine)
      : machine_(machine), loop_(world_.executor()), session_(world_.executor(), machine, store_) {
    for (const auto& bus : machine.buses) {
      ports_.push_back(world_.add_bus(bus.name, 1'000'000).attach({.name = "master"}));
      if (!session_.connect(bus.name, *ports_.back())) return;
    }
    if (!session_.open()) return;
    const auto carry = [](const command::Request&, command::Reply&) -> rt::Task<void> { co_return; };
    auto made =
        studio::Studio::start(loop_, session_, carry, {.where = {"127.0.0.1", 0}, .named = true, .simulated = true});
    if (!made) fmt::print(stderr, "{}\n", made.error());
    if (made) studio_ = std::move(*made);
    Random random(1);
    for (unsigned i = 0; i < 4096; ++i) kinds_.push_back(drawn(random, i));
  }
  /// Null: the server could not be started.
  [[nodiscard]] studio::Studio* studio() noexcept { return studio_.get(); }
  [[nodiscard]] unsigned frames() const noexcept { return number_; }
  void wait(rt::Duration time, const auto& until) {
    for (const auto end = Clock::now() + time; Clock::now() < end && !until();) loop_.turn(1ms);
  }
  /// In real time, from the first instant that is not behind.
  void run(std::chrono::milliseconds time) {
    auto next = Clock::now();
    for (auto step = 0ms; step < time; step += 1ms) {
      late_us_.push_back(std::chrono::duration<double, std::micro>(Clock::now() - next).count());
      give();
      next += 1ms;
      while (Clock::now() < next) loop_.turn(std::max<Clock::duration>(next - Clock::now(), 0ms));
    }
    wait(300ms, [] { return false; });
  }
  void tell(const std::string& of, Figures& figures) {
    figures.push_back(
        {of + "processor time of the bus's thread a frame", fmt::format("{:.0f} ns", inside_ / number_ * 1e9)});
    figures.push_back({of + "longest for 32 frames", fmt::format("{:.0f} us", longest_ * 1e6)});
    std::ranges::sort(late_us_);
    const auto at = [this](double part) {
      return late_us_[static_cast<std::size_t>(part * static_cast<double>(late_us_.size() - 1))];
    };
    figures.push_back({of + "the bus's thread behind its time, median, 99 %, longest",
                       fmt::format("{:.0f}, {:.0f}, {:.0f} us", at(0.5), at(0.99), at(1))});
  }

 private:
  void give() {
    constexpr unsigned a_ms = 32;
    const double before = thread_seconds();
    for (unsigned i = 0; i < a_ms; ++i, ++number_) {
      const auto& bus = machine_.buses[number_ % machine_.buses.size()].name;
      studio_->frame(bus, kinds_[number_ % kinds_.size()], rt::Time(rt::Duration(std::int64_t{number_} * 31'250)),
                     false);
    }
    const double took = thread_seconds() - before;
    inside_ += took;
    longest_ = std::max(longest_, took);
  }
  const design::Machine& machine_;
  sim::World world_;
  io::Loop loop_;
  places::MemoryStore store_;
  std::vector<std::unique_ptr<sim::Controller>> ports_;
  tree::Session session_;
  std::unique_ptr<studio::Studio> studio_;
  std::vector<can::Frame> kinds_;
  std::vector<double> late_us_;
  double inside_ = 0, longest_ = 0;
  unsigned number_ = 0;
};

void with_clients(unsigned count, const design::Machine& machine, Figures& figures) {
  Load load(machine);
  if (load.studio() == nullptr) return figures.push_back({"clients", "no server"});
  std::vector<std::unique_ptr<Client>> clients;
  for (unsigned i = 0; i < count; ++i) clients.push_back(std::make_unique<Client>(*load.studio()));
  load.wait(2s, [&] { return std::ranges::all_of(clients, [](const auto& c) { return c->ready.load(); }); });
  load.run(2s);
  const std::string of = fmt::format("{} clients, 4 buses at 8,000 frames/s: ", count);
  load.tell(of, figures);
  if (count == 0) return;
  std::uint64_t frames = 0, bytes = 0, least = load.frames();
  for (const auto& client : clients) {
    frames += client->frames;
    bytes += client->bytes;
    least = std::min<std::uint64_t>(least, client->frames);
  }
  figures.push_back(bench::at_most(of + "bytes on the socket a bus frame",
                                   static_cast<double>(bytes) / static_cast<double>(std::max<std::uint64_t>(frames, 1)),
                                   24, "bytes"));
  figures.push_back(
      bench::at_most(of + "frames that a client did not get", static_cast<double>(load.frames() - least), 0, "frames"));
}

/// For browsers (web/browser/figures.mjs): the address at once, and the figures behind the time.
int serve(const design::Machine& machine, std::chrono::seconds time) {
  Load load(machine);
  if (load.studio() == nullptr) return 1;
  fmt::print("{}\n", load.studio()->address(command::Role::configure));
  static_cast<void>(std::fflush(stdout));
  load.run(time);
  Figures figures;
  load.tell("", figures);
  for (const auto& figure : figures) fmt::print("{}: {}\n", figure.name, figure.measured);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const auto read = design::read_machine(machine_text, "bench.toml", {});
  if (!read.machine) return 1;
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() == 2 && words[0] == "--serve") {
    return serve(*read.machine, std::chrono::seconds(std::atoi(words[1].c_str())));
  }
  if (!words.empty()) return fmt::print(stderr, "bench_studio [--serve SECONDS]\n"), 2;
  Figures figures;
  of_the_pages(figures);
  of_the_ring(figures);
  for (const unsigned clients : {0U, 1U, 10U}) with_clients(clients, *read.machine, figures);
  bench::print_figures("Berth Studio's server", figures);
}
