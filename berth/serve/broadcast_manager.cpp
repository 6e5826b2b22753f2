#include "berth/serve/broadcast_manager.hpp"

#include <algorithm>

namespace berth::serve {

bool BroadcastManager::act(const io::SocketcandCommand& command, rt::Time now) {
  using Kind = io::SocketcandCommand::Kind;
  const auto key = command.frame.key();
  const auto job = std::ranges::find(jobs_, key, [](const Job& j) { return j.frame.key(); });
  switch (command.kind) {
    case Kind::add: return add_job(command, now);
    case Kind::update:
      if (job != jobs_.end()) job->frame = command.frame;
      return true;
    case Kind::remove:
      if (job != jobs_.end()) jobs_.erase(job);
      return true;
    case Kind::filter:
    case Kind::subscribe: return subscribe(command);
    default:
      std::erase_if(subscriptions_, [&](const Subscription& s) { return s.key == key; });
      client_->filter();
      return true;
  }
}

void BroadcastManager::clear() noexcept {
  jobs_.clear();
  subscriptions_.clear();
}

std::vector<can::IdRange> BroadcastManager::keys() const {
  std::vector<can::IdRange> keys;
  for (const auto& s : subscriptions_) keys.push_back(can::only(s.key));
  return keys;
}

bool BroadcastManager::add_job(const io::SocketcandCommand& command, rt::Time now) {
  const auto key = command.frame.key();
  std::erase_if(jobs_, [&](const Job& j) { return j.frame.key() == key; });
  if (jobs_.size() >= most) return false;
  Job job{command.frame, command.interval};
  if (job.interval.count() > 0) job.interval = std::max(job.interval, least_interval);
  job.due = now + job.interval;
  jobs_.push_back(job);
  if (job.interval.count() > 0) client_->arm(job.due);
  client_->give(command.frame);
  return true;
}

bool BroadcastManager::subscribe(const io::SocketcandCommand& command) {
  const auto key = command.frame.key();
  std::erase_if(subscriptions_, [&](const Subscription& s) { return s.key == key; });
  if (subscriptions_.size() >= most) return false;
  Subscription s;
  s.key = key;
  s.always = command.kind == io::SocketcandCommand::Kind::subscribe;
  s.interval = command.interval;
  for (std::size_t i = 0; i < command.frame.size; ++i) s.mask[i] = command.frame.data[i];
  subscriptions_.push_back(s);
  client_->filter();
  return true;
}

bool BroadcastManager::Subscription::differs(const can::Frame& frame) const noexcept {
  for (std::size_t i = 0; i < mask.size(); ++i) {
    const unsigned was = i < last.size ? last.data[i] : 0U;
    const unsigned is = i < frame.size ? frame.data[i] : 0U;
    if (((was ^ is) & mask[i]) != 0) return true;
  }
  return false;
}

void BroadcastManager::hear(const can::Frame& frame, rt::Time at) {
  const auto it = std::ranges::find(subscriptions_, frame.key(), &Subscription::key);
  if (it == subscriptions_.end()) return;
  auto& s = *it;
  if (s.heard && !s.always && !s.differs(frame)) return;
  s.last = frame;
  s.last_at = at;
  if (s.heard && at < s.told + s.interval) {
    s.waits = true;
    return client_->arm(s.told + s.interval);
  }
  s.heard = true;
  s.told = at;
  client_->tell_frame(frame, at);
}

void BroadcastManager::run(rt::Time now, bool room) {
  run_jobs(now, room);
  run_subscriptions(now);
}

void BroadcastManager::run_jobs(rt::Time now, bool room) {
  for (auto& job : jobs_) {
    if (job.interval.count() == 0) continue;
    if (now >= job.due) {
      if (room) client_->hand_over(job.frame);
      job.due += job.interval;
      if (job.due <= now) job.due = now + job.interval;
    }
    client_->arm(job.due);
  }
}

void BroadcastManager::run_subscriptions(rt::Time now) {
  for (auto& s : subscriptions_) {
    if (!s.waits) continue;
    if (now < s.told + s.interval) {
      client_->arm(s.told + s.interval);
      continue;
    }
    s.waits = false;
    s.told = now;
    if (!client_->tell_frame(s.last, s.last_at)) return;
  }
}

}  // namespace berth::serve
