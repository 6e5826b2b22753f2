// Berth devices on a kernel's CAN, against a bare raw-socket echo in the same run: what an SDO request takes in time
// and in system calls, what is received without loss, and what 127 devices in one process cost. For a machine with
// SocketCAN and root: ./run bench vm. Where the machine is emulated, only the ratios mean something.
#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/epoll.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "bench/tools/figures.hpp"
#include "berth/io/open_port.hpp"
#include "berth/plant/port_device.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

constexpr unsigned echo_node = 5;
constexpr unsigned berth_node = 6;
constexpr unsigned event_node = 7;

[[noreturn]] void die(const std::string& what) {
  fmt::print(stderr, "bench_vm_socketcan: {}: {}\n", what, std::strerror(errno));
  std::exit(1);
}

// ---- bare sockets ----

int raw_socket(const char* interface, canid_t only) {
  const int fd = ::socket(PF_CAN, SOCK_RAW, CAN_RAW);
  if (fd < 0) die("no SocketCAN");
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(interface));
  const can_filter filter{only, CAN_SFF_MASK};
  ::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, &filter, sizeof filter);
  const timeval limit{10, 0};
  ::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  const int buffer = 8 << 20;
  ::setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &buffer, sizeof buffer);
  if (::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) die(interface);  // NOLINT
  return fd;
}

void put(int fd, const can_frame& frame) {
  while (::write(fd, &frame, sizeof frame) != static_cast<ssize_t>(sizeof frame)) {
    if (errno != ENOBUFS && errno != EAGAIN) die("write");
    ::usleep(100);
  }
}

/// SDO upload of 1018h:01.
can_frame request(unsigned node) {
  can_frame frame{};
  frame.can_id = 0x600 + node;
  frame.can_dlc = 8;
  constexpr std::array<std::uint8_t, 4> data{0x40, 0x18, 0x10, 0x01};
  std::copy(data.begin(), data.end(), frame.data);
  return frame;
}

/// A program that ends with its object.
class Child {
 public:
  explicit Child(const std::function<void()>& does) : pid_(::fork()) {
    if (pid_ != 0) return;
    does();
    std::_Exit(0);
  }
  ~Child() {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  [[nodiscard]] pid_t pid() const noexcept { return pid_; }

 private:
  pid_t pid_;
};

struct Cpu {
  double user = 0, system = 0;  // seconds
};
Cpu cpu_of(pid_t pid) {
  std::string text(1024, '\0');
  std::FILE* const file = std::fopen(fmt::format("/proc/{}/stat", pid).c_str(), "r");
  if (file == nullptr) return {};
  text.resize(std::fread(text.data(), 1, text.size(), file));
  std::fclose(file);
  unsigned long user = 0, system = 0;
  const auto behind_name = text.rfind(')') + 2;
  std::sscanf(text.c_str() + behind_name, "%*c %*d %*d %*d %*d %*d %*u %*u %*u %*u %*u %lu %lu", &user,  // NOLINT
              &system);
  const auto tick = static_cast<double>(::sysconf(_SC_CLK_TCK));
  return {static_cast<double>(user) / tick, static_cast<double>(system) / tick};
}
double cpu_seconds(pid_t pid) {
  const auto cpu = cpu_of(pid);
  return cpu.user + cpu.system;
}

void echo(const char* interface) {
  const int fd = raw_socket(interface, 0x600 + echo_node);
  for (can_frame frame{};;) {
    if (::read(fd, &frame, sizeof frame) <= 0) continue;
    frame.can_id = 0x580 + echo_node;
    frame.data[0] = 0x43;
    put(fd, frame);
  }
}

/// What any program with an event loop and the kernel's times of arrival does at the least.
void event_echo(const char* interface) {
  const int fd = raw_socket(interface, 0x600 + event_node);
  const int on = 1;
  ::setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
  const int epoll = ::epoll_create1(0);
  epoll_event event{};
  event.events = EPOLLIN;
  ::epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &event);
  std::array<char, 128> control{};
  for (can_frame frame{};;) {
    if (::epoll_wait(epoll, &event, 1, -1) != 1) continue;
    iovec part{&frame, sizeof frame};
    msghdr head{};
    head.msg_iov = &part;
    head.msg_iovlen = 1;
    head.msg_control = control.data();
    head.msg_controllen = control.size();
    if (::recvmsg(fd, &head, MSG_DONTWAIT) <= 0) continue;
    frame.can_id = 0x580 + event_node;
    frame.data[0] = 0x43;
    put(fd, frame);
  }
}

// ---- Berth ----

plant::PlantDevice device(unsigned node, rt::Duration heartbeat) {
  plant::PlantDevice plan;
  plan.name = fmt::format("device {}", node);
  plan.bus = "b";
  plan.address = {1, 2, 3, node};
  plan.source = plant::NodeIdSource::nonvolatile;
  plan.node_id = NodeId(static_cast<std::uint8_t>(node));
  plan.response = {0ms, 0ms};
  plan.heartbeat = heartbeat;
  return plan;
}

/// As `berth device` has them: each with a port of its own.
void berth_devices(const char* interface, unsigned first, unsigned count, rt::Duration heartbeat) {
  rt::Executor executor;
  io::Loop loop(executor);
  plant::PortDevices devices(executor);
  Findings findings;
  for (unsigned node = first; node < first + count; ++node) {
    auto port = io::open_port(loop, {can::PortKind::socketcan, interface}, {});
    if (!port) {
      fmt::print(stderr, "{}\n", port.error());
      std::_Exit(1);
    }
    devices.add(device(node, heartbeat), std::move(*port), 0, Random(node), findings);
  }
  for (const auto& each : devices.all()) each->power(true);
  for (;;) loop.turn(10s);
}

// ---- round trips ----

/// One request and its answer, in microseconds; 0: none came.
double ask(int fd, unsigned node) {
  const auto frame = request(node);
  const auto began = std::chrono::steady_clock::now();
  put(fd, frame);
  for (can_frame answer{};;) {
    if (::read(fd, &answer, sizeof answer) <= 0) return 0;
    if (answer.can_id == 0x580 + node && answer.data[0] != 0x80) break;
  }
  return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - began).count();
}

void wait_for(int fd, unsigned node) {
  for (int i = 0; i < 10; ++i) {
    if (ask(fd, node) > 0) return;
  }
  die(fmt::format("node {} does not answer", node));
}

struct Times {
  double median, p99;
};
Times times(std::vector<double> all) {
  std::ranges::sort(all);
  return {all[all.size() / 2], all[all.size() * 99 / 100]};
}

/// One who answers, and who asks.
struct Pair {
  Pair(unsigned id, const std::function<void()>& does) : node(id), child(does), fd(raw_socket("vcan0", 0x580 + id)) {
    wait_for(fd, node);
    idle = cpu_of(child.pid());
  }
  void ask_many(unsigned count) {
    for (unsigned i = 0; i < count; ++i) all.push_back(ask(fd, node));
  }
  [[nodiscard]] std::string cpu_each() const {
    const auto now = cpu_of(child.pid());
    const double each = 1e6 / static_cast<double>(all.size());
    return fmt::format("{:.0f} us, {:.0f} us", (now.user - idle.user) * each, (now.system - idle.system) * each);
  }
  unsigned node;
  Child child;
  int fd;
  Cpu idle{};
  std::vector<double> all{};
};

void round_trips(std::vector<bench::Figure>& figures, unsigned rounds) {
  Pair bare(echo_node, [] { echo("vcan0"); });
  Pair events(event_node, [] { event_echo("vcan0"); });
  Pair berth(berth_node, [] { berth_devices("vcan0", berth_node, 1, 0ms); });
  // By turns, so that whatever else the machine does strikes all.
  for (unsigned i = 0; i < rounds; ++i) {
    for (Pair* const pair : {&bare, &events, &berth}) pair->ask_many(50);
  }
  const auto row = [&](const char* what, const Pair& pair) {
    const auto t = times(pair.all);
    const auto lost = std::ranges::count(pair.all, 0.0);
    figures.push_back(
        {what, fmt::format("{:.0f} us, {:.0f} us{}", t.median, t.p99, lost == 0 ? "" : ", some unanswered")});
    figures.push_back({"  CPU a request: user, system", pair.cpu_each()});
    return t;
  };
  const auto e = row("bare echo: median, 99th percentile", bare);
  const auto l = row("bare echo with epoll and the kernel's times", events);
  figures.push_back(
      {"  median, 99th percentile, to the echo's", fmt::format("{:.3f}, {:.3f}", l.median / e.median, l.p99 / e.p99)});
  const auto b = row("SDO expedited upload from a Berth device", berth);
  figures.push_back(bench::at_most("  median, to the echo's", b.median / e.median, 1.1, ""));
  figures.push_back(bench::at_most("  99th percentile, to the echo's", b.p99 / e.p99, 1.1, ""));
  for (const Pair* const pair : {&bare, &events, &berth}) ::close(pair->fd);
}

// ---- system calls ----

/// Counts what `traced` calls while `work` runs.
double calls_each(const std::function<void()>& traced, const std::function<void()>& work, unsigned items) {
  const Child child([&] {
    ::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr);
    ::raise(SIGSTOP);
    traced();
  });
  const pid_t pid = child.pid();
  ::waitpid(pid, nullptr, 0);
  ::ptrace(PTRACE_SETOPTIONS, pid, nullptr, PTRACE_O_TRACESYSGOOD | PTRACE_O_EXITKILL);  // NOLINT
  const Child worker(work);
  std::uint64_t stops = 0;
  std::uint64_t before = 0;
  bool at_work = false;
  // Where the measured part begins and ends the worker sends SIGUSR1, which the traced program never sees.
  ::ptrace(PTRACE_SYSCALL, pid, nullptr, nullptr);
  for (int status = 0; ::waitpid(pid, &status, 0) == pid && WIFSTOPPED(status);) {
    const int signal = WSTOPSIG(status);
    if (signal == SIGUSR1) {
      if (at_work) break;
      at_work = true;
      before = stops;
    } else if (signal == (SIGTRAP | 0x80)) {
      ++stops;
    }
    ::ptrace(PTRACE_SYSCALL, pid, nullptr, nullptr);
  }
  return static_cast<double>(stops - before) / 2 / items;  // one stop before a call, one behind it
}

void system_calls(std::vector<bench::Figure>& figures, unsigned count) {
  const auto asking = [count](unsigned node, const pid_t& traced) {
    const int fd = raw_socket("vcan0", 0x580 + node);
    wait_for(fd, node);
    ::kill(traced, SIGUSR1);
    for (unsigned i = 0; i < count; ++i) ask(fd, node);
    ::kill(traced, SIGUSR1);
  };
  const auto measured = [&](unsigned node, const std::function<void()>& traced) {
    int ends[2];
    if (::pipe(ends) != 0) die("pipe");
    const double each = calls_each(
        [&] {
          const pid_t me = ::getpid();
          if (::write(ends[1], &me, sizeof me) < 0) die("pipe");
          traced();
        },
        [&] {
          pid_t pid = 0;
          if (::read(ends[0], &pid, sizeof pid) < 0) die("pipe");
          asking(node, pid);
        },
        count);
    ::close(ends[0]);
    ::close(ends[1]);
    return each;
  };
  const double bare = measured(echo_node, [] { echo("vcan0"); });
  const double berth = measured(berth_node, [] { berth_devices("vcan0", berth_node, 1, 0ms); });
  figures.push_back({"system calls a request: bare echo", fmt::format("{:.2f}", bare)});
  figures.push_back(bench::at_most("system calls a request: Berth device", berth, 3.5, ""));
}

// ---- what is received ----

/// Counts what comes to a Berth port, and says so at the end through a pipe.
class Counting final : public can::Listener {
 public:
  void received(const can::Frame&, rt::Time) noexcept override { ++count; }
  void sent(std::uint32_t, rt::Time) noexcept override {}
  void changed(const can::Status&, rt::Time) noexcept override {}
  std::uint64_t count = 0;
};

struct Got {
  std::uint64_t frames = 0;
  std::uint64_t lost_told = 0;
};

void berth_reader(int into, unsigned expected) {
  rt::Executor executor;
  io::Loop loop(executor);
  auto port = io::open_port(loop, {can::PortKind::socketcan, "vcan0"}, {});
  if (!port) std::_Exit(1);
  Counting counting;
  const std::array all{can::IdRange{0x100, 0x100}};
  (*port)->listen(&counting, all);
  Got got{~0ULL, 0};
  if (::write(into, &got, sizeof got) < 0) std::_Exit(1);
  auto last = std::chrono::steady_clock::now();
  std::uint64_t before = 0;
  while (counting.count < expected && std::chrono::steady_clock::now() - last < 1500ms) {
    loop.turn(100ms);
    if (std::exchange(before, counting.count) != counting.count) last = std::chrono::steady_clock::now();
    if (counting.count == 0) last = std::chrono::steady_clock::now();
  }
  got = {counting.count, (*port)->status().lost};
  if (::write(into, &got, sizeof got) < 0) std::_Exit(1);
}

void bare_reader(int into, unsigned expected) {
  const int fd = raw_socket("vcan0", 0x100);
  const timeval limit{1, 500'000};
  Got got{~0ULL, 0};
  if (::write(into, &got, sizeof got) < 0) std::_Exit(1);
  got.frames = 0;
  for (can_frame frame{}; got.frames < expected; ++got.frames) {
    if (::read(fd, &frame, sizeof frame) <= 0) break;
    if (got.frames == 0) ::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  }
  if (::write(into, &got, sizeof got) < 0) std::_Exit(1);
}

struct Run {
  double rate = 0;
  Got got;
};

/// Sends `count` frames at `rate` a second; the time ends when the reader has them all.
Run offer(const std::function<void(int, unsigned)>& reader, unsigned count, double rate) {
  int ends[2];
  if (::pipe(ends) != 0) die("pipe");
  Run run;
  const Child child([&] { reader(ends[1], count); });
  if (::read(ends[0], &run.got, sizeof run.got) < 0) die("pipe");
  const int fd = raw_socket("vcan0", 0x7FF);
  can_frame frame{};
  frame.can_id = 0x100;
  frame.can_dlc = 8;
  const auto began = std::chrono::steady_clock::now();
  for (unsigned i = 0; i < count; ++i) {
    const auto due =
        began + std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(i / rate));
    if (std::chrono::steady_clock::now() < due) std::this_thread::sleep_until(due);
    put(fd, frame);
  }
  if (::read(ends[0], &run.got, sizeof run.got) < 0) die("pipe");
  run.rate = count / std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  ::close(fd);
  ::close(ends[0]);
  ::close(ends[1]);
  return run;
}

/// The highest rate at which everything came, of steps a quarter apart; until losses, or the sender cannot do more.
Run highest(const std::function<void(int, unsigned)>& reader, unsigned count) {
  Run best;
  unsigned vain = 0;
  for (double rate = 2000; rate < 2e6 && vain < 3; rate *= 1.25) {
    const auto run = offer(reader, count, rate);
    const bool better = run.got.frames == count && run.rate > best.rate;
    vain = better ? 0 : vain + 1;
    if (better) best = run;
  }
  return best;
}

void receiving(std::vector<bench::Figure>& figures, unsigned count) {
  const auto bare = highest(bare_reader, count);
  const auto berth = highest(berth_reader, count);
  figures.push_back({"received without loss: bare socket", bench::grouped(bare.rate) + " frames/s"});
  figures.push_back(
      {"received without loss: Berth port",
       fmt::format("{} frames/s, {:.2f} of the bare socket's", bench::grouped(berth.rate), berth.rate / bare.rate)});
  const auto flood = offer(berth_reader, 4 * count, 1e9);
  figures.push_back({"flat out: sent, received, told as lost",
                     fmt::format("{}, {}, {}", 4 * count, flood.got.frames, flood.got.lost_told)});
}

// ---- many devices ----

void many(std::vector<bench::Figure>& figures, double seconds) {
  const Child devices([] { berth_devices("vcan1", 1, 127, 1s); });
  const int fd = raw_socket("vcan1", 0x580 + 127);
  wait_for(fd, 127);
  ::sleep(2);
  const auto share = [&](const std::function<void(double)>& load) {
    const bench::Watch watch;
    const double before = cpu_seconds(devices.pid());
    load(seconds);
    return 100 * (cpu_seconds(devices.pid()) - before) / watch.seconds();
  };
  const double quiet = share([](double time) { ::usleep(static_cast<useconds_t>(time * 1e6)); });
  unsigned asked = 0;
  const double busy = share([&](double time) {
    const bench::Watch watch;
    while (watch.seconds() < time) {
      if (ask(fd, 127) > 0) ++asked;
      ::usleep(10'000);
    }
  });
  figures.push_back({"127 devices in one process, heartbeats of 1 s", fmt::format("{:.1f} % of a CPU", quiet)});
  figures.push_back(
      {fmt::format("  and {:.0f} SDO requests/s", asked / seconds), fmt::format("{:.1f} % of a CPU", busy)});
  ::close(fd);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "--device") {  // by itself, for strace and perf
    berth_devices("vcan0", berth_node, 1, 0ms);
  }
  const bool quick = argc > 1 && std::string_view(argv[1]) == "--quick";
  if (::if_nametoindex("vcan0") == 0 || ::if_nametoindex("vcan1") == 0) {
    fmt::print(stderr, "bench_vm_socketcan: vcan0 and vcan1 are not here; ./run bench vm\n");
    return 3;
  }
  std::vector<bench::Figure> figures;
  round_trips(figures, quick ? 4 : 40);
  system_calls(figures, quick ? 100 : 1000);
  receiving(figures, quick ? 2000 : 20'000);
  many(figures, quick ? 3 : 10);
  bench::print_figures("Berth on the kernel's CAN (vcan)", figures);
  return 0;
}
