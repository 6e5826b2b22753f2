// A device made of Berth's library on any port, for the tests against other software (tests/peers): what plays no part
// on a simulated bus is in the application's hands here, and the application is written through objects by SDO. It is
// an SDO client too: it does what it is told on standard input, a line a transfer.
//
//     build/test/berth_partner socketcand://127.0.0.1:29536/can0 BUS NODE SERIAL
//     upload NODE INDEX SUB           ->   ok HEX        or   no REASON
//     download NODE INDEX SUB HEX     ->   ok            or   no REASON
//     block-upload, block-download    ->   the same by block transfer
//
// NODE 255: without a node-ID; LSS gives it one. Ends with its standard input, 3 when the port cannot be opened.
#include <fcntl.h>
#include <sys/epoll.h>
#include <unistd.h>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <sstream>

#include "berth/client/remote_node.hpp"
#include "berth/device/device.hpp"
#include "berth/io/open_port.hpp"
#include "berth/rt/scope.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

using od::Access, od::DataType, od::Literal;

std::shared_ptr<const od::Description> dictionary() {
  od::DescriptionBuilder b;
  device::add_device(b, {.name = "Berth, the partner of other stacks"});
  device::add_sync(b);
  b.variable(0x1012, {.name = "COB-ID TIME", .initial = Literal::number(0xC000'0100)});  // consumer and producer
  b.sub(0x1028, {.sub = 10, .name = "Emergency consumer 10", .initial = Literal::number(0x8000'0000)});
  b.sub(0x1028, {.sub = 127, .name = "Emergency consumer 127", .initial = Literal::number(0x8000'0000)});
  b.variable(0x2000,
             {.name = "Sent when it changes", .type = DataType::unsigned16, .access = Access::rw, .mappable = true});
  b.variable(0x2001, {.name = "Received and sent back", .type = DataType::unsigned32, .mappable = true});
  b.variable(0x2010, {.name = "Text", .type = DataType::visible_string, .capacity = 4096});
  b.variable(0x2011, {.name = "Bytes", .type = DataType::domain, .capacity = 65536});
  b.variable(
      0x2012,
      {.name = "At most 100", .type = DataType::unsigned8, .low = Literal::number(1), .high = Literal::number(100)});
  b.variable(0x2013, {.name = "Eight bytes", .type = DataType::unsigned64});
  b.variable(
      0x2014,
      {.name = "Read only", .type = DataType::unsigned16, .access = Access::ro, .initial = Literal::number(0x1234)});
  b.variable(0x2015, {.name = "Write only", .type = DataType::unsigned16, .access = Access::wo});
  b.variable(0x2020, {.name = "TIME heard, ms", .type = DataType::unsigned32});
  b.variable(0x2021, {.name = "TIME heard, days", .type = DataType::unsigned16});
  b.variable(0x2022, {.name = "Written: sends that TIME", .type = DataType::unsigned8});
  b.variable(0x2030, {.name = "Raises this error", .type = DataType::unsigned16});
  b.variable(0x2031, {.name = "Clears this error", .type = DataType::unsigned16});
  b.variable(0x2040, {.name = "SYNCs heard", .type = DataType::unsigned32});
  b.variable(0x2041, {.name = "Counter of the last", .type = DataType::unsigned8});
  b.variable(0x2050, {.name = "Code of the last emergency heard", .type = DataType::unsigned16});
  b.variable(0x2051, {.name = "Node that it came from", .type = DataType::unsigned8});
  b.variable(0x2060, {.name = "State of the last heartbeat event", .type = DataType::unsigned8});
  b.variable(0x2061, {.name = "Its kind", .type = DataType::unsigned8});
  device::add_tpdo(b, 1, {.map = {{{0x2000, 0}, 16}}});
  device::add_tpdo(b, 2, {.map = {{{0x2001, 0}, 32}}, .type = 1});
  device::add_rpdo(b, 1, {.map = {{{0x2001, 0}, 32}}});
  return b.build();
}

class Partner {
 public:
  Partner(rt::Executor& executor, can::Port& port, NodeId node, std::uint32_t serial)
      : dispatcher_(executor, port),
        flash_(executor, 4096, 5ms),
        device_(dispatcher_, dictionary(), &flash_, {.address = {0x123, 7, 0x1'0000, serial}, .node_id = node}) {
    device_.on().time = [this](const co::TimeOfDay& time) {
      set<std::uint32_t>(0x2020, time.milliseconds);
      set<std::uint16_t>(0x2021, time.days);
    };
    device_.on().sync = [this](std::uint8_t counter) {
      set<std::uint32_t>(0x2040, get<std::uint32_t>(0x2040) + 1);
      set<std::uint8_t>(0x2041, counter);
    };
    device_.on().emergency = [this](NodeId from, const co::Emcy& emergency) {
      set<std::uint16_t>(0x2050, emergency.code);
      set<std::uint8_t>(0x2051, static_cast<std::uint8_t>(from.value()));
    };
    device_.on().heartbeat = [this](const co::HeartbeatEvent& event) {
      set<std::uint8_t>(0x2060, static_cast<std::uint8_t>(event.state));
      set<std::uint8_t>(0x2061, static_cast<std::uint8_t>(event.kind));
    };
    device_.on_write({0x2000, 0}, [this] { device_.services().changed({0x2000, 0}); });
    device_.on_write({0x2022, 0}, [this] {
      device_.services().send_time({get<std::uint32_t>(0x2020), get<std::uint16_t>(0x2021)});
    });
    device_.on_write({0x2030, 0}, [this] {
      device_.errors().raise(get<std::uint16_t>(0x2030), co::error_register::voltage, {1, 2, 3, 4, 5});
    });
    device_.on_write({0x2031, 0}, [this] { device_.errors().clear(get<std::uint16_t>(0x2031)); });
    device_.power_on();
  }

  can::Dispatcher& dispatcher() { return dispatcher_; }

 private:
  template <class T>
  T get(std::uint16_t index) {
    return device_.variable<T>({index, 0}).get();
  }
  template <class T>
  void set(std::uint16_t index, T value) {
    device_.variable<T>({index, 0}).store(value);
  }

  can::Dispatcher dispatcher_;
  device::SimFlash flash_;
  device::Device device_;
};

std::string hex(std::span<const std::uint8_t> bytes) {
  std::string text;
  for (const unsigned byte : bytes) {
    text += "0123456789ABCDEF"[byte >> 4U];
    text += "0123456789ABCDEF"[byte & 15U];
  }
  return text;
}

std::vector<std::uint8_t> bytes_of(const std::string& text) {
  std::vector<std::uint8_t> bytes(text.size() / 2);
  for (std::size_t i = 0; i < bytes.size(); ++i)
    std::from_chars(text.data() + 2 * i, text.data() + 2 * i + 2, bytes[i], 16);
  return bytes;
}

void say(const std::string& line) {
  std::puts(line.c_str());
  std::fflush(stdout);
}

rt::Task<void> transfer(co::SdoClient& client, std::string line) {
  std::istringstream words(line);
  std::string verb;
  std::string data;
  unsigned node = 0;
  unsigned index = 0;
  unsigned sub = 0;
  words >> verb >> std::dec >> node >> std::hex >> index >> std::dec >> sub >> data;
  co::SdoOptions options;
  options.timeout = 10s;
  options.mode = verb.starts_with("block") ? co::SdoMode::block : co::SdoMode::segmented;
  options.fall_back = false;
  const NodeId server(static_cast<std::uint8_t>(node));
  const auto at = static_cast<std::uint16_t>(index);
  const auto sub_index = static_cast<std::uint8_t>(sub);
  if (verb.ends_with("upload")) {
    const auto read = co_await client.upload(server, at, sub_index, options);
    say(read ? "ok " + hex(read->bytes()) : "no " + describe(read.error()));
  } else {
    const auto bytes = bytes_of(data);
    const auto written = co_await client.download(server, at, sub_index, bytes, options);
    say(written ? std::string("ok") : "no " + describe(written.error()));
  }
}

/// Lines of standard input.
class Orders final : public io::Watcher {
 public:
  Orders(io::Loop& loop, co::SdoClient& client, rt::Scope& scope) : client_(&client), scope_(&scope) {
    ::fcntl(STDIN_FILENO, F_SETFL, ::fcntl(STDIN_FILENO, F_GETFL) | O_NONBLOCK);
    loop.watch(STDIN_FILENO, *this, EPOLLIN);
  }
  bool over = false;

 private:
  void ready(std::uint32_t) noexcept override {
    std::array<char, 4096> some{};
    const auto got = ::read(STDIN_FILENO, some.data(), some.size());
    if (got == 0) over = true;
    if (got <= 0) return;
    waiting_.append(some.data(), static_cast<std::size_t>(got));
    for (auto end = waiting_.find('\n'); end != std::string::npos; end = waiting_.find('\n')) {
      scope_->spawn(transfer(*client_, waiting_.substr(0, end)));
      waiting_.erase(0, end + 1);
    }
  }
  co::SdoClient* client_;
  rt::Scope* scope_;
  std::string waiting_;
};

}  // namespace

int main(int count, char** words) {
  const auto spec = count == 5 ? can::parse_port(words[1]) : std::nullopt;
  if (!spec) {
    std::fprintf(stderr, "usage: %s PORT BUS NODE SERIAL\n", words[0]);
    return 2;
  }
  rt::Executor executor;
  io::Loop loop(executor);
  const auto port = io::open_port(loop, *spec, {.bus = words[2]});
  if (!port) {
    std::fprintf(stderr, "%s\n", port.error().c_str());
    return 3;
  }
  const auto node = static_cast<std::uint8_t>(std::strtoul(words[3], nullptr, 0));
  Partner partner(executor, **port, NodeId(node), static_cast<std::uint32_t>(std::strtoul(words[4], nullptr, 0)));
  co::SdoClient client(partner.dispatcher());
  rt::Scope scope(executor);
  Orders orders(loop, client, scope);
  say("ready");
  while (!orders.over) loop.turn(1s);
  scope.cancel();
  return 0;
}
