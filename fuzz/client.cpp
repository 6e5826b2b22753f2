// Any frames at an application's side of a network, with accesses, subscriptions and commands begun, dropped and their
// nodes destroyed in between: each callback comes at most once, none after its node, and an honest device is read.
#include "berth/client/remote_node.hpp"
#include "fuzz/bench_port.hpp"

namespace client_target {

namespace {

using namespace berth;
using fuzz::require;

std::shared_ptr<const client::Names> names() {
  using od::DataType, od::Literal;
  od::DescriptionBuilder b;
  b.variable(0x1000, {.name = "Device type"});
  b.variable(0x2000, {.name = "text", .type = DataType::visible_string});
  b.variable(0x2001, {.name = "wide text", .type = DataType::unicode_string});
  b.variable(0x2002, {.name = "time", .type = DataType::time_of_day});
  b.variable(0x2003, {.name = "short", .type = DataType::integer24});
  b.variable(0x2004, {.name = "real", .type = DataType::real32});
  return std::make_shared<const client::Names>(b.build());
}

/// How often each callback of one access came.
struct Count {
  template <class T>
  void operator()(const client::Outcome<T>& outcome) const {
    require(++*calls == 1 && *alive);
    require(outcome || !outcome.error().message.empty());
  }
  std::shared_ptr<int> calls = std::make_shared<int>(0);
  std::shared_ptr<bool> alive;  // the node
};

class World {
 public:
  explicit World(std::shared_ptr<const client::Names> table) : names_(std::move(table)) { make_node(); }
  void step(fuzz::Input& in) {
    const std::uint8_t kind = in.byte();
    switch (kind & 15U) {
      case 0: node_->read<std::string>("text", count()); break;
      case 1: node_->read<std::string>("wide text", count()); break;
      case 2: node_->read<co::TimeOfDay>("time", count()); break;
      case 3: node_->read<std::int32_t>("short", count()); break;
      case 4: node_->read<double>("real", count()); break;
      case 5: node_->write("short", static_cast<std::int32_t>(in.word()), count()); break;
      case 6: node_->subscribe(1, subscribed()); break;
      case 7: node_->open(1, opened()); break;
      case 8: node_->nmt(co::NmtCommand::reset_node, count()); break;
      case 9: make_node(); break;
      case 10: port_.hear(in.frame(0x585)); break;
      case 11: port_.hear(in.frame(0x705)); break;
      case 12: port_.hear(in.frame(0x085)); break;
      case 13: port_.hear(in.frame(in.word())); break;
      case 14: port_.hear(in.frame(0x185)); break;
      default: executor_.advance(executor_.now() + std::chrono::microseconds(in.half() * 10));
    }
  }
  /// Node 5 answers as it should: 1000h is read.
  void honest() {
    make_node();
    executor_.advance(executor_.now() + std::chrono::seconds(20));
    std::optional<std::uint32_t> type;
    bool asked = false;
    port_.on_sent = [&asked](const can::Frame& frame) { asked = frame.id == 0x605 && frame.data[0] == 0x40; };
    node_->read<std::uint32_t>("Device type", [&type](const auto& value) { type = value.value_or(0); });
    for (int i = 0; i < 10 && !asked; ++i) executor_.advance(executor_.now() + std::chrono::milliseconds(1));
    port_.hear(can::Frame::base(0x585, {0x43, 0, 0x10, 0, 1, 2, 3, 4}));
    executor_.advance(executor_.now() + std::chrono::milliseconds(1));
    require(type == 0x04030201U);
  }

 private:
  Count count() { return {.alive = alive_}; }
  std::function<void(client::Outcome<std::shared_ptr<client::Tpdo>>)> subscribed() {
    return [once = count()](const client::Outcome<std::shared_ptr<client::Tpdo>>& pdo) {
      once(pdo);
      if (!pdo) return;
      (*pdo)->on_pdo([alive = once.alive](const client::PdoSample& sample) {
        require(*alive);
        require(sample.layout->bits <= 64);
        for (const auto& field : sample.layout->fields) require(sample.get<client::Value>(field.object).has_value());
      });
    };
  }
  std::function<void(client::Outcome<std::shared_ptr<client::Rpdo>>)> opened() {
    return [once = count()](const client::Outcome<std::shared_ptr<client::Rpdo>>& pdo) {
      once(pdo);
      if (!pdo) return;
      for (const auto& field : (*pdo)->layout().fields) {
        (void)(*pdo)->set(field.object, 1);
        (void)(*pdo)->set(field.object, -1);
      }
      (void)(*pdo)->send();
    };
  }
  void make_node() {
    if (alive_ != nullptr) *alive_ = false;
    alive_ = std::make_shared<bool>(true);
    node_.reset();
    node_ = std::make_unique<client::RemoteNode>(network_, NodeId(5), names_);
    node_->on_emcy([alive = alive_](const client::Emergency& e) { require(*alive && e.text() != nullptr); });
    node_->on_state([alive = alive_](const client::StateEvent&) { require(*alive); });
  }

  std::shared_ptr<const client::Names> names_;
  rt::Executor executor_;
  fuzz::BenchPort port_{executor_};
  can::Dispatcher dispatcher_{executor_, port_};
  client::Network network_{dispatcher_};
  std::shared_ptr<bool> alive_;
  std::unique_ptr<client::RemoteNode> node_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto table = names();
  fuzz::Input in(data, size);
  World world(table);
  while (!in.empty()) world.step(in);
  world.honest();
  return 0;
}

}  // namespace client_target
