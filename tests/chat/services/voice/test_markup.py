"""What of a written answer is spoken."""

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ico3d.chat.services.voice.markup import speakable


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("**Bold**, *italic*, __both__, _one_ and ~~gone~~.", "Bold, italic, both, one and gone."),
        ("**Half of it.", "Half of it."),
        ("And the rest.**", "And the rest."),
        ("这是**重点**内容", "这是重点内容"),
        ("## A title", "A title"),
        ("- an entry", "an entry"),
        ("  * [x] done", "done"),
        ("1. first", "1. first"),
        ("> quoted", "quoted"),
        ("```python", ""),
        ("```", ""),
        ("---", ""),
        ("Use `print(x)` here.", "Use print(x) here."),
        ("See [the page](https://a.b/c) now.", "See the page now."),
        ("![A cat](cat.png)", "A cat"),
        ("snake_case and 2*3 = 6, 2 * 3, 2**3", "snake_case and 2*3 = 6, 2 * 3, 2**3"),
        ("a*b", "a b"),
        ("#1 of 5, C#, -5 °C, C♯", "#1 of 5, C#, -5 °C, C♯"),
        ("Nice 😀👍🏽👨‍👩‍👧!", "Nice !"),
        ("I ❤️ it ✅ ▶️", "I  it  "),
        ("🇩🇪 Deutschland 3️⃣", " Deutschland 3"),
        ("© 2024 Müller ½ ²", "© 2024 Müller ½ ²"),
        ("क्‍ष می‌خواهم", "क्‍ष می‌خواهم"),
        ("😀", ""),
        ("…", ""),
        ("|---|:-:|", ""),
    ],
)
async def test_words_are_said_and_markup_is_not(written, said):
    assert await speakable(written) == said


async def test_cells_of_a_table_are_said():
    assert (await speakable("| name | age |")).split() == ["name", "age"]


def words(text):
    """Letters, marks and digits, without the marks that only say how an emoji looks."""
    kinds = {char: unicodedata.category(char)[0] for char in text}
    return [char for char in text if kinds[char] in "LMN" and char not in "\ufe0f\u20e3"]


MARKS = st.sampled_from(list("*_#>-+|=.,:! \n19aZéß你สمहि😀❤\u200d\u0301"))
PLAIN = st.characters(blacklist_characters="[`~", blacklist_categories=["Cs"])


@given(st.one_of(st.text(PLAIN), st.lists(MARKS).map("".join)))
async def test_no_letter_of_any_script_is_lost(text):
    said = await speakable(text)
    if any(map(str.isalnum, text)):
        assert words(said) == words(text)
    else:
        assert said == ""


@given(
    st.text(st.characters(categories=["L", "N", "M", "Zs"], blacklist_characters="\ufe0f\u20e3"))
)
async def test_text_without_markup_stays_as_it_is(text):
    assert await speakable(text) == (text if any(map(str.isalnum, text)) else "")
