/// Carries out the steps of a `RecipeBinding` on a bus.
#pragma once

#include <string>

#include "berth/places/binder.hpp"
#include "berth/places/recipe_binding.hpp"

namespace berth::places {

class RecipeBinder {
 public:
  RecipeBinder(const Binder::Services& services, const Binder::Options& options, const Recipe& recipe)
      : s_(services), options_(options), recipe_(&recipe) {}

  /// Runs the table to its end. All arguments must outlive the task.
  [[nodiscard]] rt::Task<void> run(RecipeBinding& binding, SlotId slot, const std::string& reason);

  /// As `Binder::store_said`.
  [[nodiscard]] const std::optional<Error>& store_said() const noexcept { return store_said_; }

  /// The bytes to write for one object, little-endian.
  [[nodiscard]] static std::vector<std::uint8_t> bytes(const Recipe::Write& write, NodeId id);

 private:
  rt::Task<Outcome> perform(const RecipeBinding& binding, SlotId slot, const std::string& reason);
  rt::Task<Outcome> identify(NodeId id, const Identity& device);
  rt::Task<Outcome> write(NodeId at, NodeId id);
  rt::Task<Outcome> reset(const RecipeBinding& binding);

  Binder::Services s_;
  Binder::Options options_;
  const Recipe* recipe_;
  std::optional<Error> store_said_;
  rt::Time identified_{};  // under the old node-ID
  rt::Time moved_{};       // from then on it may boot under the new one
};

}  // namespace berth::places
