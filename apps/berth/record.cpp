#include "record.hpp"

#include <cerrno>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "berth/operate/report.hpp"
#include "berth/trace/candump.hpp"
#include "options.hpp"

namespace berth::cli {

using Json = nlohmann::ordered_json;

std::string candump_line(const Recorded& f) {
  if (!f.at_s) return f.frame;
  return trace::candump_line(rt::Duration(std::llround(*f.at_s * 1e9)), f.bus, f.frame);
}

void print_dry_run(const std::vector<Recorded>& frames, const command::Reply* reply, bool json) {
  if (!json) {
    for (const auto& f : frames) print_line(candump_line(f));
    if (reply != nullptr && !reply->error.empty()) print_error(reply->error);
    return;
  }
  Json all;
  all["dry_run"] = true;
  all["frames"] = Json::array();
  for (const auto& f : frames) {
    all["frames"].push_back({{"at_s", f.at_s ? Json(*f.at_s) : Json(nullptr)}, {"bus", f.bus}, {"frame", f.frame}});
  }
  if (reply != nullptr) all["reply"] = Json::parse(reply->json);
  print_line(all.dump(2));
}

Record::~Record() {
  if (log_ != nullptr) std::fclose(log_);
}

tl::expected<void, Failure> Record::write_to(const std::string& path) {
  log_ = std::fopen(path.c_str(), "we");
  if (log_ != nullptr) return {};
  return tl::unexpected(failure(Exit::failed, path + ": " + std::strerror(errno)));
}

void Record::frame(const std::string& bus, const can::Frame& frame, rt::Time at, bool by_master) {
  const Recorded recorded{operate::seconds(at), bus, can::to_string(frame), by_master};
  if (log_ != nullptr) {
    const std::string line = candump_line(recorded) + '\n';
    failed_ = failed_ || std::fwrite(line.data(), 1, line.size(), log_) != line.size();
  }
  if (sent_ != nullptr && by_master) sent_->push_back(recorded);
}

}  // namespace berth::cli
