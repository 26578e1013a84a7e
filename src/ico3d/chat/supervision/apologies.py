"""Sentences that the avatar says when a service has failed, or a tool takes its time."""

from typing import Literal

from ico3d.chat.services.voice import espeak

Failed = Literal["recognition", "language", "voice"]

APOLOGIES: dict[str, dict[Failed, str]] = {
    "en": {
        "recognition": "Sorry, I could not hear you properly. Please say it again.",
        "language": "Sorry, I cannot think of an answer right now. Please ask me again.",
        "voice": "Sorry, my voice fails me. Please read my answer.",
    },
    "de": {
        "recognition": "Entschuldigung, ich habe Sie nicht verstanden. Bitte noch einmal.",
        "language": "Entschuldigung, mir fällt gerade keine Antwort ein. Bitte noch einmal.",
        "voice": "Entschuldigung, meine Stimme versagt. Bitte lesen Sie meine Antwort.",
    },
    "fr": {
        "recognition": "Pardon, je n'ai pas bien entendu. Pouvez-vous répéter ?",
        "language": "Pardon, je ne trouve pas de réponse. Pouvez-vous redemander ?",
        "voice": "Pardon, ma voix me lâche. Veuillez lire ma réponse.",
    },
    "es": {
        "recognition": "Perdón, no le he oído bien. ¿Puede repetirlo?",
        "language": "Perdón, ahora no encuentro una respuesta. ¿Puede volver a preguntar?",
        "voice": "Perdón, me falla la voz. Lea mi respuesta, por favor.",
    },
    "it": {
        "recognition": "Scusi, non ho sentito bene. Può ripetere?",
        "language": "Scusi, ora non trovo una risposta. Può chiedere di nuovo?",
        "voice": "Scusi, mi manca la voce. Legga la mia risposta, per favore.",
    },
    "pt": {
        "recognition": "Desculpe, não ouvi bem. Pode repetir?",
        "language": "Desculpe, agora não encontro uma resposta. Pode perguntar de novo?",
        "voice": "Desculpe, a minha voz falhou. Leia a minha resposta, por favor.",
    },
    "ru": {
        "recognition": "Извините, я не расслышала. Повторите, пожалуйста.",
        "language": "Извините, сейчас я не нахожу ответа. Спросите ещё раз.",
        "voice": "Извините, голос меня подвёл. Пожалуйста, прочтите мой ответ.",
    },
    "zh": {
        "recognition": "抱歉,我没有听清楚。请再说一遍。",
        "language": "抱歉,我现在想不出答案。请再问一次。",
        "voice": "抱歉,我的声音出了问题。请阅读我的回答。",
    },
    "ja": {
        "recognition": "すみません、よく聞こえませんでした。もう一度お願いします。",
        "language": "すみません、今は答えが思いつきません。もう一度聞いてください。",
        "voice": "すみません、声が出ません。答えを読んでください。",
    },
    "ko": {
        "recognition": "죄송합니다, 잘 듣지 못했어요. 다시 말씀해 주세요.",
        "language": "죄송합니다, 지금은 답이 떠오르지 않아요. 다시 물어봐 주세요.",
        "voice": "죄송합니다, 목소리가 나오지 않아요. 제 대답을 읽어 주세요.",
    },
    "ar": {
        "recognition": "عذرًا، لم أسمعك جيدًا. من فضلك أعد ما قلت.",
        "language": "عذرًا، لا أجد جوابًا الآن. من فضلك اسأل مرة أخرى.",
        "voice": "عذرًا، صوتي لا يعمل. من فضلك اقرأ جوابي.",
    },
}
"""Apologies by language (ISO 639-1) and failed service."""

WAITING = {
    "en": "One moment, please.",
    "de": "Einen Moment, bitte.",
    "fr": "Un instant, s'il vous plaît.",
    "es": "Un momento, por favor.",
    "it": "Un momento, per favore.",
    "pt": "Um momento, por favor.",
    "ru": "Одну минуту.",
    "zh": "请稍等。",
    "ja": "少々お待ちください。",
    "ko": "잠시만요.",
    "ar": "لحظة من فضلك.",
}
"""By language, what is said while a tool works: short, as the answer is asked for behind it."""


def apology(failed: Failed, language: str) -> str:
    """The apology for a failed service; in English for languages without one.

    Args:
        failed: The failed service.
        language: A code such as `de` or `pt-BR`.
    """
    return APOLOGIES.get(base(language), APOLOGIES["en"])[failed]


def waiting(language: str) -> str:
    """What is said while a tool works; in English for languages without such a sentence."""
    return WAITING.get(base(language), WAITING["en"])


def espeak_voice(language: str) -> str:
    """espeak-ng's voice for apologies in a language."""
    code = base(language)
    return espeak.voice_of(code if code in APOLOGIES else "en")


def base(language: str) -> str:
    """A language code without region: `pt` for `pt-BR`."""
    return language.split("-")[0].lower()
