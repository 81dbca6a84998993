// The templates of Ros2Services, for its two bodies only.
#pragma once

#include <spdlog/spdlog.h>

#include <chrono>
#include <memory>
#include <string_view>
#include <utility>

#include "server/ros2/ros2_services.h"

namespace cairn::server {

// So long an answer waits for discovery to find the reader of a program that has asked as soon as it was there.
inline constexpr std::chrono::seconds kAnswerWaits{2};
inline constexpr std::size_t kMostUndelivered = 256;

template <typename S>
std::uint64_t Ros2Services::Asked<S>::asker() const {
  constexpr std::size_t kParticipantBytes = 12;
  return HashName({reinterpret_cast<const char*>(caller.writer.data()), kParticipantBytes});
}

template <typename S>
void Ros2Services::Offer(const std::string& service, Endpoints& endpoints,
                         std::function<void(typename S::Request&&, const Asked<S>&)> serve) {
  auto answers = bus_.AdvertiseAnswers<S>(service);
  if (!answers) return spdlog::warn("ROS 2: {} is not served: {}", service, answers.error().message);
  const std::shared_ptr<ros2::Answers<S>> shared = *std::move(answers);
  auto requests = bus_.SubscribeRequests<S>(
      service, [serve = std::move(serve), shared](typename S::Request&& request, const ros2::Caller& caller) {
        serve(std::move(request), Asked<S>{caller, shared});
      });
  if (!requests) return spdlog::warn("ROS 2: {} is not served: {}", service, requests.error().message);
  endpoints.push_back(*std::move(requests));
}

template <typename S>
bool Ros2Services::Send(const Asked<S>& asked, const typename S::Response& response) {
  if (!asked.answers->Reaches(asked.caller)) return false;
  if (!asked.answers->Send(asked.caller, response)) unanswered_.fetch_add(1, std::memory_order_relaxed);
  return true;
}

template <typename S>
void Ros2Services::Answer(const Asked<S>& asked, const typename S::Response& response) {
  if (Send(asked, response)) return;
  if (undelivered_.size() >= kMostUndelivered) {
    undelivered_.pop_front();
    unanswered_.fetch_add(1, std::memory_order_relaxed);
  }
  undelivered_.push_back({now_ + kAnswerWaits, [this, asked, response] { return Send(asked, response); }});
}

}  // namespace cairn::server
