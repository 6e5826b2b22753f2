#include "../pch.hpp"
#include "rig.hpp"
namespace berth::tree_tests {
struct Tap final : can::Tap {
  Tap(std::string n, sim::World& w) : name(std::move(n)), world(w) {}
  void frame(const can::Frame& f, rt::Time at, int) noexcept override {
    auto t = can::to_string(f);
    if (std::getenv("ALL") == nullptr && t[0] == '7') return;
    printf("%.6f %s %s\n", std::chrono::duration<double>(at.time_since_epoch()).count(), name.c_str(), t.c_str());
  }
  std::string name; sim::World& world;
};
TEST(Scratch, X) {
  const auto made = chain(std::atoi(std::getenv("G")), std::atoi(std::getenv("R")), std::atoi(std::getenv("V")));
  Rig rig(made.machine, made.plant);
  std::vector<std::unique_ptr<Tap>> taps;
  for (const auto& b : rig.world().sim().buses()) { taps.push_back(std::make_unique<Tap>(b->name(), rig.world().sim())); b->add_tap(*taps.back()); }
  EXPECT_TRUE(rig.up(std::chrono::minutes(20)));
  for (std::size_t i = 0; i < taps.size(); ++i) rig.world().sim().buses()[i]->remove_tap(*taps[i]);
  printf("%s", rig.log().c_str());
}
}
