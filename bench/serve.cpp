// Frames per second through the socketcand server, over loopback: from a bus to clients, from a client to a bus, and
// how long it takes until a frame of the client port is `sent`. The bus is a port that takes and gives as fast as it is
// asked.
#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <deque>
#include <thread>
#include <vector>

#include "berth/io/socketcand_port.hpp"
#include "berth/serve/socketcand_server.hpp"

namespace {

using namespace berth;
using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// Gives a frame whenever the executor has nothing else to do, and confirms what it is given at once.
class Bus final : public can::Port, private rt::Job {
 public:
  Bus(rt::Executor& executor, bool gives) : executor_(&executor), gives_(gives) {}
  can::Queued send(const can::Frame&, std::uint32_t tag) noexcept override {
    taken.fetch_add(1, std::memory_order_relaxed);
    tags_.push_back(tag);
    executor_->post(*this);
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t) noexcept override {}
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    hears_ = !accept.empty();
    if (gives_ && hears_) executor_->post(*this);
  }
  [[nodiscard]] can::Status status() const noexcept override {
    can::Status s;
    s.up = true;
    return s;
  }
  bool restart(std::uint32_t) noexcept override { return true; }

  static inline std::atomic<std::uint64_t> taken{0};
  static inline std::atomic<std::uint64_t> given{0};
  static inline std::atomic<std::uint64_t> allowed{0};

 private:
  void run() noexcept override {
    if (listener_ == nullptr) return;
    if (!tags_.empty()) {
      const auto tag = tags_.front();
      tags_.pop_front();
      listener_->sent(tag, executor_->now());
      if (!tags_.empty()) executor_->post(*this);
      return;
    }
    if (!gives_ || !hears_) return;
    if (mine_ < allowed.load(std::memory_order_relaxed)) {
      ++mine_;
      listener_->received(can::Frame::base(0x181, {1, 2, 3, 4, 5, 6, 7, 8}), executor_->now());
      executor_->post(*this);
    } else {
      executor_->after(100us, *this);
    }
  }
  rt::Executor* executor_;
  bool gives_;
  bool hears_ = false;
  can::Listener* listener_ = nullptr;
  std::deque<std::uint32_t> tags_;
  std::uint64_t mine_ = 0;
};

/// The server in a thread of its own.
class House {
 public:
  explicit House(bool gives) {
    auto made = serve::SocketcandServer::listen(
        loop_, {"127.0.0.1", 0},
        [this, gives](const std::string&, std::string&) { return std::make_unique<Bus>(executor_, gives); }, {});
    server_ = std::move(made.value());
    where = server_->where();
    thread_ = std::thread([this] {
      while (!over_) loop_.turn(1ms);
    });
  }
  ~House() {
    over_ = true;
    thread_.join();
  }
  House(const House&) = delete;
  House& operator=(const House&) = delete;
  io::Endpoint where;

 private:
  rt::Executor executor_;
  io::Loop loop_{executor_};
  std::unique_ptr<serve::SocketcandServer> server_;
  std::atomic<bool> over_{false};
  std::thread thread_;
};

class Socket {
 public:
  explicit Socket(const io::Endpoint& where) {
    fd_ = io::begin_connect(io::look_up(where).value().front());
    while (!say("")) std::this_thread::sleep_for(1ms);
    for (const auto* text : {"< open a >", "< rawmode >", "< echo >"}) {
      wait();
      say(text);
    }
    wait();
  }
  ~Socket() { ::close(fd_); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  bool say(std::string_view text) const {
    do {
      const auto n = ::send(fd_, text.data(), text.size(), MSG_NOSIGNAL);
      if (n < 0 && errno != EAGAIN) return false;
      if (n > 0) text.remove_prefix(static_cast<std::size_t>(n));
    } while (!text.empty());
    return true;
  }
  // Elements that came.
  std::uint64_t count() const {
    std::array<char, 65536> buffer;
    const auto n = ::recv(fd_, buffer.data(), buffer.size(), 0);
    return n <= 0 ? 0 : static_cast<std::uint64_t>(std::count(buffer.data(), buffer.data() + n, '>'));
  }
  void wait() const {
    while (count() == 0) std::this_thread::sleep_for(1ms);
  }

 private:
  int fd_ = -1;
};

double seconds(Clock::duration d) { return std::chrono::duration<double>(d).count(); }

void to_clients(unsigned clients) {
  constexpr std::uint64_t frames = 200'000;
  const std::uint64_t each = frames / clients;
  House house(true);
  Bus::allowed = 0;
  std::vector<std::unique_ptr<Socket>> sockets;
  for (unsigned i = 0; i < clients; ++i) sockets.push_back(std::make_unique<Socket>(house.where));
  const auto began = Clock::now();
  std::uint64_t heard = 0;
  std::uint64_t step = 0;
  while (heard < each * clients) {
    // In steps, so that nobody is found too slow.
    if (heard >= step * clients && step < each) Bus::allowed = step = std::min(each, step + 2000);
    for (const auto& s : sockets) heard += s->count();
  }
  fmt::print("{:<36} {:>12.0f} frames/s\n", fmt::format("bus to {} client{}", clients, clients == 1 ? "" : "s"),
             static_cast<double>(heard) / seconds(Clock::now() - began));
}

void from_client() {
  constexpr std::uint64_t frames = 200'000;
  House house(false);
  Bus::taken = 0;
  Socket socket(house.where);
  std::string some;
  for (int i = 0; i < 100; ++i) some += "< send 181 8 1 2 3 4 5 6 7 8 >";
  const auto began = Clock::now();
  for (std::uint64_t i = 0; i < frames / 100; ++i) socket.say(some);
  while (Bus::taken < frames) std::this_thread::yield();
  fmt::print("{:<36} {:>12.0f} frames/s\n", "client to bus",
             static_cast<double>(frames) / seconds(Clock::now() - began));
}

class Ear final : public can::Listener {
 public:
  void received(const can::Frame&, rt::Time) noexcept override {}
  void sent(std::uint32_t tag, rt::Time) noexcept override { last = tag; }
  void changed(const can::Status&, rt::Time) noexcept override {}
  std::uint32_t last = 0;
};

void until_sent() {
  constexpr std::uint32_t trials = 5000;
  House house(false);
  rt::Executor executor;
  io::Loop loop(executor);
  const auto port = io::SocketcandPort::connect(loop, io::to_string(house.where) + "/a", {}).value();
  Ear ear;
  port->listen(&ear, {});
  std::vector<double> times;
  for (std::uint32_t i = 1; i <= trials; ++i) {
    const auto began = Clock::now();
    port->send(can::Frame::base(0x601, {0x40, 0, 0x10, 0, 0, 0, 0, 0}), i);
    while (ear.last != i) loop.turn(10ms);
    times.push_back(seconds(Clock::now() - began) * 1e6);
  }
  std::ranges::sort(times);
  fmt::print("{:<36} {:>9.1f} us median, {:.1f} us 99th percentile\n", "from `send` to `sent`", times[trials / 2],
             times[trials * 99 / 100]);
}

}  // namespace

int main() {
  for (const unsigned clients : {1U, 4U, 16U}) to_clients(clients);
  from_client();
  until_sent();
}
