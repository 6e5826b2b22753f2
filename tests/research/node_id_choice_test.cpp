// Which node-ID a device would have, without a bus (berth/research/node_id_choice.hpp).
#include "berth/research/node_id_choice.hpp"

#include <gtest/gtest.h>

namespace berth::research {
namespace {

using namespace std::chrono_literals;

TEST(NodeIdChoice, S2_21_TheLastOneIsPreferredToTheConfiguredOne) {
  const NegotiatorOptions options{.configured = NodeId(5)};
  NodeIdChoice choice(options);
  EXPECT_EQ(choice.choose({}), NodeId(5));
  choice.prefer(NodeId(9));
  EXPECT_EQ(choice.choose({}), NodeId(9));
}

TEST(NodeIdChoice, TheNextFreeOneBehind127Is1) {
  const NegotiatorOptions options{.configured = NodeId(127)};
  NodeIdChoice choice(options);
  choice.heard(NodeId(127));
  EXPECT_EQ(choice.choose({}), NodeId(1));
  choice.begin();
  EXPECT_EQ(choice.choose({}), NodeId(127));
}

TEST(NodeIdChoice, ALostOneIsAvoidedForATime) {
  const NegotiatorOptions options{.configured = NodeId(5)};
  NodeIdChoice choice(options);
  const rt::Time until = rt::Time{} + 30s;
  choice.avoid(NodeId(5), until);
  EXPECT_EQ(choice.choose(until - 1ns), NodeId(6));
  EXPECT_EQ(choice.choose(until), NodeId(5));
}

TEST(NodeIdChoice, AllInUseIsNone) {
  const NegotiatorOptions options{};
  NodeIdChoice choice(options);
  for (unsigned id = 1; id <= 127; ++id) choice.heard(NodeId(static_cast<std::uint8_t>(id)));
  EXPECT_FALSE(choice.choose({}).configured());
}

}  // namespace
}  // namespace berth::research
