/// `berth up` as a service: what the service manager that started it (systemd) hears of the run.
#pragma once

#include <memory>
#include <string>

#include "berth/io/service_manager.hpp"
#include "machine_run.hpp"
#include "reload.hpp"

namespace berth::cli {

/// Says READY=1 when every slot that is not optional is operational, or with `--ready started` at once; STATUS= with
/// the slots that are missing, at most once a second; WATCHDOG=1 from the run's loop, twice in the manager's time;
/// RELOADING=1 around a reload; STOPPING=1 at the end.
class Service {
 public:
  /// Null: no service manager started this process, or the run is not in real time. `start`: the machine file's text
  /// (`Reload::text_of`). `run` and what `say` uses outlive it.
  [[nodiscard]] static std::unique_ptr<Service> start(MachineRun& run, const Options& options,
                                                      const std::optional<std::string>& start, Reload::Say say);
  ~Service();
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;

  /// The session's state may have changed.
  void event() noexcept { changed_ = true; }
  /// Call it between two instants: says what has changed.
  void look();

 private:
  class Beat;
  Service(MachineRun& run, io::ServiceManager manager, bool at_once);
  [[nodiscard]] std::string status() const;
  void reload();

  MachineRun& run_;
  io::ServiceManager manager_;
  std::unique_ptr<Beat> beat_;  // null: no watchdog
  std::unique_ptr<Reload> reload_;
  bool at_once_;
  bool ready_ = false;
  bool changed_ = true;
  std::string told_;
  std::chrono::steady_clock::time_point told_at_{};
};

}  // namespace berth::cli
