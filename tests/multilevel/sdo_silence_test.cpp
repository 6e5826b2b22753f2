// Transfers through gateways that fall silent in the middle, on the one side or on the other (docs/multilevel.md §SDO):
// who asked is told, nothing stays under way, and the next access works.
#include <gtest/gtest.h>

#include <string>

#include "tree.hpp"

namespace berth::multilevel::test {
namespace {

constexpr ObjectRef domain{0x2004, 0};

// One transfer of 15,000 bytes, and what takes part in it.
struct Transfer {
  unsigned depth;
  bool down;
  co::SdoMode above;
  bool block_beneath;
  [[nodiscard]] std::string text() const {
    return std::to_string(depth) + (down ? " down" : " up") + (above == co::SdoMode::block ? " block" : " segments") +
           (block_beneath ? ", block beneath" : "");
  }
  static std::vector<Transfer> all() {
    std::vector<Transfer> made;
    for (const unsigned depth : {1U, 2U}) {
      for (const bool down : {false, true}) {
        for (const auto above : {co::SdoMode::segmented, co::SdoMode::block}) {
          for (const bool block : {false, true}) made.push_back({depth, down, above, block});
        }
      }
    }
    return made;
  }
};

struct Begun : Chain {
  explicit Begun(const Transfer& is) : Chain(is.depth), what(is) {
    co::SdoOptions options;
    options.mode = is.above;
    routes.emplace(*client, options);
    auto& node = dynamic_cast<GatewayAccess&>(routes->access(path));
    node.set_block_from(is.block_beneath ? 5 : 100'000);
    access = &node;
    leaf->device.values().set_bytes(domain, bytes);
    scope.emplace(world.executor());
    scope->spawn(is.down ? write(*access, bytes, outcome) : read(*access, outcome));
    world.run_until([&] { return lines.back()->log.size() > 300; }, 10s);
    EXPECT_FALSE(outcome) << "the test stops it in the middle";
  }
  static rt::Task<void> write(co::SdoAccess& node, const Bytes& data, std::optional<Result<void>>& into) {
    const std::span<const std::uint8_t> all = data;
    const auto done = co_await node.write(domain.index, domain.sub, all);
    into = done;
  }
  static rt::Task<void> read(co::SdoAccess& node, std::optional<Result<void>>& into) {
    const auto value = co_await node.read(domain.index, domain.sub);
    into = value ? Result<void>() : Result<void>(fail(value.error()));
  }
  [[nodiscard]] std::size_t busy() const {
    std::size_t all = 0;
    for (const auto& each : gateways) all += each->gateway.busy();
    return all;
  }
  /// The same once more, and the other way.
  void expect_works() {
    const Bytes others = numbers(15'000, 99);
    const auto written = await(world, access->write(domain.index, domain.sub, others));
    EXPECT_TRUE(written) << describe(written.error());
    EXPECT_EQ(bytes_of(await(world, access->read(domain.index, domain.sub))), others);
    EXPECT_EQ(busy(), 0U);
  }
  Transfer what;
  Bytes bytes = numbers(15'000);
  std::optional<Routes> routes;
  co::SdoAccess* access = nullptr;
  std::optional<Result<void>> outcome;
  std::optional<rt::Scope> scope;
};

}  // namespace

// The node beneath loses power in the middle: a time-out above that names it, from the lowest gateway.
TEST(SdoGatewaySilence, TheNodeBeneath) {
  for (const auto& what : Transfer::all()) {
    SCOPED_TRACE(what.text());
    Begun begun(what);
    begun.leaf->device.power_off();
    const rt::Time since = begun.world.now();
    EXPECT_TRUE(begun.world.run_until([&] { return begun.outcome.has_value(); }, 10s)) << "it hangs";
    ASSERT_TRUE(begun.outcome);
    ASSERT_FALSE(*begun.outcome);
    EXPECT_EQ(begun.outcome->error().code, Errc::timeout) << describe(begun.outcome->error());
    EXPECT_EQ(begun.outcome->error().node, 50);
    EXPECT_EQ(begun.outcome->error().index, domain.index);
    EXPECT_STREQ(begun.outcome->error().text, "no answer beneath the gateway");
    EXPECT_LE(begun.world.now() - since, 3s) << "one time-out beneath, not one of each level";
    EXPECT_EQ(begun.busy(), 0U);
    begun.leaf->device.power_on();
    begun.world.run_for(100ms);
    begun.expect_works();
  }
}

// The client above takes its frames no more in the middle, without a word: what it has begun ends on every bus, and the
// node beneath is told so.
TEST(SdoGatewaySilence, TheClientAbove) {
  for (const auto& what : Transfer::all()) {
    SCOPED_TRACE(what.text());
    Begun begun(what);
    begun.master->controller->power(false);
    begun.world.run_for(10s);
    EXPECT_EQ(begun.busy(), 0U);
    const auto& log = begun.lines.back()->log;
    EXPECT_TRUE(log.back().starts_with("632#80") || log.back().starts_with("5B2#80")) << log.back();
    begun.master->controller->power(true);
    EXPECT_TRUE(begun.world.run_until([&] { return begun.outcome.has_value(); }, 10s)) << "it hangs";
    begun.world.run_for(10ms);  // the gateway's abort, which no node has acknowledged meanwhile
    begun.expect_works();
  }
}

// One who breaks off with an abort: at once.
TEST(SdoGatewaySilence, TheClientBreaksOff) {
  for (const auto& what : Transfer::all()) {
    SCOPED_TRACE(what.text());
    Begun begun(what);
    begun.scope->cancel();
    EXPECT_TRUE(begun.world.run_until([&] { return begun.busy() == 0; }, 3s));
    begun.world.run_for(100ms);
    const auto& log = begun.lines.back()->log;
    EXPECT_TRUE(log.back().starts_with("632#80") || log.back().starts_with("5B2#80")) << log.back();
    begun.expect_works();
  }
}

}  // namespace berth::multilevel::test
