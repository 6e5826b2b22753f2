/// A server with one bus, and clients that are plain sockets. The executor is turned by this thread, the server has its
/// own.
#pragma once

#include "berth/studio/studio.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "berth/command/audit.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/sim/world.hpp"

namespace berth::studio {

using namespace std::chrono_literals;
using Json = nlohmann::json;

inline constexpr std::string_view machine_text = R"(
[machine]
name = "bench"
[bus.field]
port = "sim"
bitrate = 125_000
[[slot]]
bus = "field"
id = 5
name = "drive"
type = { vendor = 0x1, product = 0x2 }
)";

class Connection {
 public:
  Connection(std::uint16_t port, std::function<void()> turn, int receive_buffer = 0) : turn_(std::move(turn)) {
    fd_ = io::begin_connect(io::look_up({"127.0.0.1", port}).value().front());
    if (receive_buffer > 0) ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
  }
  ~Connection() { ::close(fd_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;
  void say(std::string_view text) {
    for (int i = 0; i < 20'000 && !text.empty(); ++i) {
      const auto n = ::send(fd_, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
      if (n > 0) text.remove_prefix(static_cast<std::size_t>(n));
      if (n < 0 && errno != EAGAIN && errno != ENOTCONN) return;
      turn_();
    }
  }
  void hear() {
    std::array<char, 65536> buffer;
    const auto n = ::recv(fd_, buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (n == 0 || (n < 0 && errno != EAGAIN && errno != ENOTCONN)) ended = true;
    if (n > 0) in.append(buffer.data(), static_cast<std::size_t>(n));
  }
  template <class Done>
  bool until(Done done) {
    for (int i = 0; i < 20'000; ++i) {
      hear();
      if (done()) return true;
      turn_();
    }
    return false;
  }
  /// A whole answer of HTTP.
  std::string answer() {
    std::size_t whole = 0;
    const bool came = until([&] {
      const auto head = in.find("\r\n\r\n");
      if (head == std::string::npos) return ended;
      const auto length = in.find("Content-Length: ");
      whole = head + 4 + (length < head ? std::stoul(in.substr(length + 16)) : 0);
      return in.size() >= whole || ended;
    });
    EXPECT_TRUE(came);
    std::string out = in.substr(0, whole);
    in.erase(0, whole);
    return out;
  }
  /// One message of a WebSocket, whose head it takes away; pings are passed over.
  std::string message(int* opcode = nullptr) {
    for (;;) {
      std::size_t head = 2, size = 0;
      const bool came = until([&] {
        if (in.size() < 2) return ended;
        size = static_cast<unsigned char>(in[1]) & 127U;
        const std::size_t more = size == 126 ? 2 : size == 127 ? 8 : 0;
        head = 2 + more;
        if (in.size() < head) return ended;
        if (more > 0) size = 0;
        for (std::size_t i = 0; i < more; ++i) size = size << 8U | static_cast<unsigned char>(in[2 + i]);
        return in.size() >= head + size || ended;
      });
      if (!came || in.size() < head + size) return {};
      const int code = in[0] & 15;
      std::string text = in.substr(head, size);
      const bool last = (in[0] & 128) != 0;
      in.erase(0, head + size);
      if (code > 8) continue;
      if (code != 0) kind_ = code, part_.clear();
      part_ += text;
      if (!last) continue;
      if (opcode != nullptr) *opcode = kind_;
      return part_;
    }
  }
  /// The next text message of this type.
  Json next(const std::string& type) {
    for (int i = 0; i < 1000; ++i) {
      int opcode = 0;
      const auto text = message(&opcode);
      if (text.empty()) return {};
      if (opcode != 1) continue;
      auto json = Json::parse(text, nullptr, false);
      if (json.is_object() && json["type"] == type) return json;
    }
    return {};
  }
  void send(std::string_view text) {
    std::string frame{static_cast<char>(0x81)};
    if (text.size() < 126) {
      frame += static_cast<char>(0x80U | text.size());
    } else {
      frame += static_cast<char>(0x80U | 127U);
      for (int i = 7; i >= 0; --i) frame += static_cast<char>(text.size() >> (8U * static_cast<unsigned>(i)) & 255U);
    }
    frame += std::string(4, '\0');  // a mask that changes nothing
    frame += text;
    say(frame);
  }
  bool hung_up() {
    return until([&] { return ended; });
  }
  std::string in;
  bool ended = false;

 private:
  std::function<void()> turn_;
  int fd_;
  int kind_ = 0;
  std::string part_;
};

class StudioServer : public ::testing::Test {
 protected:
  StudioServer() {
    const auto read = design::read_machine(machine_text, "bench.toml", {});
    for (const auto& finding : read.findings) std::cerr << to_string(finding) << "\n";
    if (!read.machine) throw std::runtime_error("the machine of this test is none");
    machine_ = *read.machine;
    port_ = world_.add_bus("field", 125'000).attach({.name = "master"});
    session_ = std::make_unique<tree::Session>(world_.executor(), machine_, store_);
    EXPECT_TRUE(session_->connect("field", *port_));
    EXPECT_TRUE(session_->open());
    session_->on_event([this](const operate::Event& event) {
      if (studio_) studio_->event(event);
    });
    start();
  }
  ~StudioServer() override { session_->on_event({}); }
  void start(std::size_t frames = 1U << 16U, bool open_metrics = false) {
    studio_.reset();
    auto made =
        Studio::start(loop_, *session_, [this](const auto& request, auto& reply) { return carry(request, reply); },
                      {.where = {"127.0.0.1", 0},
                       .named = true,
                       .token_file = file_,
                       .simulated = true,
                       .version = "1.2.3",
                       .open_metrics = open_metrics,
                       .frames = frames,
                       .signals = signals_});
    ASSERT_TRUE(made) << made.error();
    studio_ = std::move(*made);
  }
  rt::Task<void> carry(const command::Request& request, command::Reply& reply) {
    ++carried_;
    if (command::changes(request)) ++changed_;
    if (request.verb == "report") co_await rt::sleep_for(10ms);
    if (request.verb == "scan") co_await rt::sleep_for(10h);
    reply.json = R"({"done":true})";
    reply.lines.push_back("done");
  }
  std::unique_ptr<Connection> connect(int receive_buffer = 0) {
    return std::make_unique<Connection>(
        studio_->where().port, [this] { loop_.turn(1ms); }, receive_buffer);
  }
  std::string own() const { return fmt::format("127.0.0.1:{}", studio_->where().port); }
  std::string head(const std::string& line, const std::string& more = {}) const {
    return line + " HTTP/1.1\r\nHost: " + own() + "\r\n" + more + "\r\n";
  }
  const std::string& token(command::Role role = command::Role::configure) const { return studio_->tokens().of(role); }
  static std::string first_line(const std::string& path) {
    std::string line;
    std::getline(std::ifstream(path), line);
    return line;
  }
  std::string bearer() const { return "Authorization: Bearer " + token() + "\r\n"; }
  std::string post(const std::string& body) const {
    return head("POST /api/v1/request",
                bearer() + fmt::format("Origin: http://{}\r\nContent-Length: {}\r\n", own(), body.size())) +
           body;
  }
  std::string socket(const std::string& token, const std::string& origin) const {
    return head("GET /api/v1/socket",
                "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: berth.v1, token." +
                    token + "\r\nOrigin: " + origin + "\r\n");
  }
  std::string status_of(const std::string& request) {
    auto client = connect();
    client->say(request);
    return client->answer().substr(0, 12);
  }
  /// One that has its snapshot.
  std::unique_ptr<Connection> page(int receive_buffer = 0, command::Role role = command::Role::configure) {
    auto client = connect(receive_buffer);
    client->say(socket(token(role), "http://" + own()));
    EXPECT_EQ(client->answer().substr(0, 12), "HTTP/1.1 101");
    snapshot_ = client->next("snapshot");
    EXPECT_TRUE(snapshot_.is_object());
    return client;
  }
  void frames(unsigned count) {
    for (unsigned i = 0; i < count; ++i)
      studio_->frame("field", can::Frame::base(0x705, {static_cast<std::uint8_t>(i % 3 == 0 ? 0x7F : 0x05)}),
                     rt::Time(std::chrono::microseconds(1000 + frames_++)), i % 2 == 0);
  }

  std::string signals_ =
      R"({"buses":[{"bus":"field","messages":[{"id":389,"ext":false,"name":"TPDO 1","sender":"drive","signals":[)"
      R"({"name":"speed","at":0,"bits":16,"type":"signed","object":"6000h:01","unit":"rpm","factor":0.1,)"
      R"("values":[{"raw":0,"name":"stands"}]}]}]}]})";
  std::string file_ = fmt::format("{}/studio_{}.token", ::testing::TempDir(), ::getpid());
  sim::World world_;
  io::Loop loop_{world_.executor()};
  design::Machine machine_;
  places::MemoryStore store_;
  std::unique_ptr<sim::Controller> port_;
  std::unique_ptr<tree::Session> session_;
  std::unique_ptr<Studio> studio_;
  Json snapshot_;
  unsigned carried_ = 0;
  unsigned changed_ = 0;  // of them, by requests that change something
  std::int64_t frames_ = 0;
};

}  // namespace berth::studio
