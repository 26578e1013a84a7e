"""Built-in sentences for synthetic people, with a variety of mouth shapes."""

import re

SENTENCES = (
    "Good morning, my name is not important, but I am happy to meet you.",
    "The birch canoe slid past the wooden bridge before the rain began.",
    "Please put the purple paper on top of the broken piano.",
    "How many people would move to a small village by the sea?",
    "Bob and Pam baked a pumpkin pie and brought it to the public park.",
    "We wove a warm woollen blanket while the wind went around the house.",
    "She sells fresh fish and chips at the corner shop every Thursday.",
    "My mother remembers the summer when the apple trees bloomed twice.",
    "You should choose a juicy orange, not the one with the bruise.",
    "Five very brave firemen saved a family from the flames.",
    "I think that nothing is harder than telling the whole truth.",
    "A huge yellow moon rose over the quiet blue water.",
    "Could you open the window above the old oak table?",
    "He thought about the zebra that he saw at the zoo yesterday.",
    "Every evening the baker's boy plays the trumpet for the neighbours.",
    "No one knows who wrote the letter or where it came from.",
    "Keep the key in the kitchen cupboard, behind the green kettle.",
    "Maybe we ought to begin again, from the top, with a bit more rhythm.",
    "The judge joked about the huge bridge and everybody laughed.",
    "What a beautiful view; the valley, the river, and the far white mountains!",
    "Put both bowls below the bed, and bring me my big brown boots.",
    "Sixteen swans swam south across the silver lake.",
    "Our room was empty apart from two chairs and a round mirror.",
    "They argued over lunch, but by four o'clock they were friends.",
    "Ah, now I see; oh, that is wonderful; eat, ooze, and away!",
    "Tomorrow the temperature may drop below zero in the eastern hills.",
    "Do you prefer tea with lemon, or coffee with a little milk?",
    "The musician improvised a melody on a borrowed mandolin.",
    "Fourteen thousand voters have already voted for the other proposal.",
    "Look up: the clouds are moving fast, and a storm is on its way.",
    "I usually measure the garage before I buy another machine.",
    "Mimi hummed a lullaby till the baby dreamed of butterflies.",
    "Both theories were proved wrong by a simple thought experiment.",
    "Wash your hands, peel the potatoes, and chop the mushrooms.",
    "An hour ago the whole orchestra was waiting outside in the snow.",
    "Peter, Paul and Mabel prepared a plan to paint the old barn.",
)
"""The sentences; the seed of a recording decides their order."""


def sentences_of(text: str) -> list[str]:
    """Splits a text behind full stops, question marks and exclamation marks."""
    return [s.strip() for s in re.split(r"(?<=[.!?])\s+", text) if s.strip()]
