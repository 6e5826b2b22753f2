/// The parts of a `Network`, in order of knowledge: each knows those above it, and none below.
#pragma once

#include "berth/operate/finder.hpp"
#include "berth/operate/recipe_seating.hpp"
#include "berth/operate/slot_startup.hpp"
#include "berth/operate/starter.hpp"
#include "berth/operate/supervision.hpp"

namespace berth::operate {

/// The parts that look for devices.
struct Finding {
  ConfiguredFinder configured;
  Search search;
  Finder finder;
};

struct NetworkParts {
  NetworkParts(rt::Executor& executor, can::Port& port, std::string machine, const design::Bus& bus,
               std::vector<places::SlotSpec> specs, places::SlotStore& store, NetworkObserver observer,
               co::HeartbeatConsumer::Observer& heartbeats, co::GuardingMaster::Observer& guarding,
               co::EmcyConsumer::Observer& emcys);

  BusServices bus;
  SlotTable slots;
  Agenda agenda;
  SlotStartup startup;
  Loans loans;
  FoundDevices found;
  ErasedNodeIds erased;
  Asking asking;
  Lending lending;
  Duplicates duplicates;
  PlaceProbes places;
  Configuring configuring;
  Presence presence;
  Planning planning;
  Finding finding;
  Seating seating;
  RecipeSeating recipes;
  Spares spares;
  Starter starter;
  Supervision supervision;
};

}  // namespace berth::operate
